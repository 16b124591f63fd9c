// Vectors and matrices of scripts: arithmetic, labels, text, files, and what is answered to shapes that do not fit.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/io/hdf5_file.hpp"
#include "scripts/lua/matrix.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

struct Bench {
  std::string out;
  LuaHost host;
  explicit Bench(LuaOptions options = {}) : host(with_print(std::move(options), out)) { open_matrices(host); }
  static LuaOptions with_print(LuaOptions options, std::string& out) {
    options.print = [&out](std::string_view line) { out.append(line) += '\n'; };
    return options;
  }
  std::string run(const std::string& text) {
    out.clear();
    host.run_text("test.lua", text);
    return out;
  }
  /// The fault of the first diagnostic: "at | expected | got".
  std::string fault(const std::string& text) {
    try {
      run(text);
    } catch (const InputError& e) {
      const Diagnostic& d = e.diagnostics().front();
      return d.about.empty() ? d.at.key_path + " | " + d.expected + " | " + d.got : d.about;
    }
    return "no error";
  }
  double number(const std::string& expression) {
    double x = std::nan("");
    const std::string text = "return " + expression;
    host.protect([&](lua_State* L) {
      if (luaL_loadbufferx(L, text.data(), text.size(), "@test.lua", "t") != LUA_OK) lua_error(L);
      lua_call(L, 0, 1);
      x = lua_tonumber(L, -1);
    });
    return x;
  }
};

TEST(LuaMatrix, ReadsAndSetsEntriesFromOne) {
  Bench b;
  EXPECT_EQ(b.run("local v = vector{1, 2, 3} v[2] = 7 print(#v, v[1], v[2], v[3], v:rows(), v:cols())"), "3\t1.0\t7.0\t3.0\t3\t1\n");
  EXPECT_EQ(b.run("local A = matrix{{1, 2, 3}, {4, 5, 6}} A:set(2, 1, 9) print(#A, A:rows(), A:cols(), A[1][3], A(2, 1), A:column(2)[2])"),
            "2\t2\t3\t3.0\t9.0\t5.0\n");
  EXPECT_EQ(b.run("local t = matrix{{1, 2}, {3, 4}}:table() print(#t, t[2][1]) print(#vector{5, 6}:table())"), "2\t3.0\n2\n");
}

TEST(LuaMatrix, ComputesAsOnPaper) {
  Bench b;
  b.run("A, B, x = matrix{{1, 2}, {3, 4}}, matrix{{0, 1}, {1, 0}}, vector{5, 6}");
  EXPECT_EQ(b.run("print(A * B == matrix{{2, 1}, {4, 3}}, B * A == matrix{{3, 4}, {1, 2}}, A * x == vector{17, 39})"),
            "true\ttrue\ttrue\n");
  EXPECT_EQ(b.run("print(A:t() == matrix{{1, 3}, {2, 4}}, x:t() * A == matrix{{23, 34}}, x:dot(x))"), "true\ttrue\t61.0\n");
  EXPECT_EQ(b.run("print(2 * A - A == A, A * 2 == A + A, -x + x == vector{0, 0}, x / 2 == vector{2.5, 3})"), "true\ttrue\ttrue\ttrue\n");
  EXPECT_EQ(b.run("print(A == B, A == x, vector{1} == matrix{{1}})"), "false\tfalse\tfalse\n");
  EXPECT_EQ(b.run("print((matrix{{1, 2, 3}} * matrix{{1}, {1}, {1}})(1, 1))"), "6.0\n");
}

TEST(LuaMatrix, NormsAreTheTwoNormAndTheLargestEntry) {
  Bench b;
  EXPECT_EQ(b.number("vector{3, -4}:norm()"), 5.0);
  EXPECT_DOUBLE_EQ(b.number("vector{3e300, -4e300}:norm()"), 5e300) << "no overflow on the way";
  EXPECT_DOUBLE_EQ(b.number("vector{3e-300, 4e-300}:norm()"), 5e-300);
  EXPECT_EQ(b.number("matrix{{1, -9}, {3, 4}}:max_abs()"), 9.0);
  // Singular values of [1 1; 0 1]: golden ratio and its inverse.
  const double golden = 0.5 * (1.0 + std::sqrt(5.0));
  EXPECT_NEAR(b.number("matrix{{1, 1}, {0, 1}}:norm()"), golden, 4e-16 * golden);
  EXPECT_NEAR(b.number("matrix{{3, 4, 0}}:norm()"), 5.0, 4e-15) << "of one row: its length";
  EXPECT_NEAR(b.number("matrix{{3, 4, 0}}:t():norm()"), 5.0, 4e-15);
  EXPECT_EQ(b.number("vector{}:norm()"), 0.0);
  EXPECT_TRUE(std::isnan(b.number("vector{1, 0/0, 2}:max_abs()")));
}

TEST(LuaMatrix, SolvesWhateverTheUnitsOfTheRows) {
  Bench b;
  EXPECT_EQ(b.run("print(matrix{{2, 1}, {1, 4}}:solve{4, 9} == vector{1, 2})"), "true\n");
  // The same system with its second unknown in a unit 2^60 larger; powers of two round nothing.
  EXPECT_EQ(b.run("local s = 2.0 ^ 30 print(matrix{{2 / s ^ 2, 1}, {1, 4 * s ^ 2}}:solve{4 / s, 9 * s} == vector{s, 2 / s})"), "true\n");
  EXPECT_EQ(b.run("print(matrix{{0, 1}, {1, 0}}:solve(matrix{{1, 2}, {3, 4}}) == matrix{{3, 4}, {1, 2}})"), "true\n");
  const std::string singular = b.fault("matrix{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}:solve{1, 2, 3}");
  EXPECT_TRUE(singular.starts_with("solve | a regular matrix | a matrix 3x3 that is singular")) << singular;
}

TEST(LuaMatrix, EigenvaluesOfSymmetricMatricesAscend) {
  Bench b;
  b.run("e = matrix{{2, 1, 0}, {1, 2, 1}, {0, 1, 2}}:eigenvalues()");  // 2 - sqrt 2, 2, 2 + sqrt 2
  EXPECT_NEAR(b.number("e[1]"), 2.0 - std::sqrt(2.0), 4e-15);
  EXPECT_NEAR(b.number("e[2]"), 2.0, 4e-15);
  EXPECT_NEAR(b.number("e[3]"), 2.0 + std::sqrt(2.0), 4e-15);
  EXPECT_EQ(b.fault("matrix{{0 / 0, 1}, {1, 0}}:eigenvalues()"), "eigenvalues | a matrix of finite numbers | one that is not finite");
  EXPECT_EQ(b.fault("matrix{{1, 2}, {2.5, 1}}:eigenvalues()"), "eigenvalues | a symmetric matrix | A(1, 2) = 2, A(2, 1) = 2.5");
}

TEST(LuaMatrix, ShapesThatDoNotFitAreNamed) {
  Bench b;
  b.run("A, x = matrix{{1, 2, 3}, {4, 5, 6}, {7, 8, 10}}, vector{1, 2, 3, 4}");
  EXPECT_EQ(b.fault("return A * x"),
            "matrix 3x3 times vector of 4 | a number, a vector of 3 or a matrix of 3 rows on the right | matrix 3x3 and vector of 4");
  EXPECT_EQ(b.fault("return x * A"), "vector of 4 times matrix 3x3 | a number or a matrix on the left | vector of 4 and matrix 3x3");
  EXPECT_EQ(b.fault("return x * {1}"), "vector of 4 times {1} | a number or a matrix on the left | vector of 4 and {1}");
  EXPECT_EQ(b.fault("return A + x"), "matrix 3x3 plus vector of 4 | two of the same shape | matrix 3x3 and vector of 4");
  EXPECT_EQ(b.fault("return A - 1"), "matrix 3x3 minus 1 (number) | two of the same shape | matrix 3x3 and 1 (number)");
  EXPECT_EQ(b.fault("return A:solve(x)"), "matrix 3x3:solve(vector of 4) | a right-hand side of 3 rows | a vector of 4");
  EXPECT_EQ(b.fault("return A:solve{1}"), "the right-hand side of matrix 3x3 | a vector or a table of 3 numbers | a table of 1");
  EXPECT_EQ(b.fault("return x:dot(A)"), "vector of 4 dot matrix 3x3 | two vectors of one length | vector of 4 and matrix 3x3");
  EXPECT_EQ(b.fault("return 1 / x"), "1 (number) divided by vector of 4 | a number on the right | vector of 4");
  EXPECT_EQ(b.fault("return matrix{{1, 2}, {3}}"), "matrix[2] | a vector or a table of 2 numbers | a table of 1");
  EXPECT_EQ(b.fault("return vector{1, '2'}"), "vector[2] | a number | \"2\" (string)");
  EXPECT_EQ(b.fault("return vector{1, 2, w = 3}"), "vector | a vector or a table of numbers | a table with other keys than 1, 2, ...");
  EXPECT_EQ(b.fault("return matrix{{1, 2}, {3, 4}, rows = 2}"),
            "matrix | a matrix or a table of rows | a table with other keys than 1, 2, ...");
  EXPECT_EQ(b.fault("return vector({1, 2}, {unit = {'m', 'm'}})"),
            "labels of the vector | {names = {...}, units = {...}} with 2 texts each | a table with other keys");
  EXPECT_EQ(b.fault("return x[5]"), "index of vector of 4 | 1 to 4 | 5 (number)");
  EXPECT_EQ(b.fault("return x[1.5]"), "index of vector of 4 | 1 to 4 | 1.5 (number)");
  EXPECT_EQ(b.fault("x[0] = 1"), "index of vector of 4 | 1 to 4 | 0 (number)");
  EXPECT_EQ(b.fault("return A(1, 4)"), "column of matrix 3x3 | 1 to 3 | 4 (number)");
  EXPECT_EQ(b.fault("A[1][2] = 3"), "a row of a matrix | A:set(i, j, x) | an assignment to an index");
  EXPECT_EQ(b.fault("return A.solve(x, x)"), "solve | a matrix before the colon | a vector of 4");
  EXPECT_EQ(b.fault("return A.t(1)"), "vector, matrix | a vector or a matrix before a colon | 1 (number)");
  EXPECT_EQ(b.run("print(pcall(function() return A * x end))").substr(0, 6), "false\t") << "a script may catch it";
}

TEST(LuaMatrix, LabelsFollowTheAlgebra) {
  Bench b;
  b.run(
      "A = matrix({{1, 2}, {3, 4}}, {names = {'a', 'b'}, units = {'N m', 'N'}}, {names = {'x', 'y'}, units = {'rad', 'm'}})"
      "v = vector({1, 2}, {names = {'x', 'y'}})");
  EXPECT_EQ(b.run("print(A['b']['x'], A('b', 'y'), v['y'])"), "3.0\t4.0\t2.0\n");
  EXPECT_EQ(b.run("local l = (A * v):labels() print(l.names[2], l.units[1])"), "b\tN m\n");
  EXPECT_EQ(b.run("local r, c = A:t():labels() print(r.names[1], c.units[2])"), "x\tN\n");
  EXPECT_EQ(b.run("print(A:solve{1, 2}:labels().names[1], (2 * v):labels().names[2], A[1]:labels().units[2])"), "x\ty\tm\n");
  EXPECT_EQ(b.run("local w = vector({1, 2}, {names = {'p', 'q'}}) print((v + w):labels().names, (v + vector{1, 2}):labels().names[1])"),
            "nil\tx\n")
      << "labels that differ say nothing of the sum";
  EXPECT_EQ(
      b.fault("return v['z']"),
      "vector of 2 | one of its names: x, y, or a method: cols, csv, dot, hdf5, labels, max_abs, norm, rows, t, table | \"z\" (string)");
  EXPECT_EQ(b.fault("return vector({1, 2}).z"),
            "vector of 2 | 1 to 2, or a method: cols, csv, dot, hdf5, labels, max_abs, norm, rows, t, table | \"z\" (string)");
  EXPECT_EQ(b.fault("return A('a', 'xx')"), "column of matrix 2x2 | 1 to 2, or one of its names | \"xx\" (string)");
  EXPECT_EQ(b.fault("return vector({1, 2}, {names = {'a'}})"),
            "labels of the vector.names | {names = {...}, units = {...}} with 2 texts each | 1 of them");
}

TEST(LuaMatrix, TextHasNamesUnitsAndSixDigits) {
  Bench b;
  EXPECT_EQ(b.run("print(matrix({{1, 1 / 3}, {-2e-10, 4}}, {names = {'alpha', 'b'}, units = {'N m', 'N'}}, {names = {'x', 'y'}, units = "
                  "{'rad', 'm'}}))"),
            "matrix 2x2\n"
            "                    x         y\n"
            "                [rad]       [m]\n"
            "  alpha [N m]       1  0.333333\n"
            "  b [N]        -2e-10         4\n");
  EXPECT_EQ(b.run("print(vector({1, 20}, {units = {'m', 'rad'}}))"), "vector of 2\n  1 [m]     1\n  2 [rad]  20\n");
  EXPECT_EQ(b.run("print(matrix{{1, 20}, {300, 4}}) print(vector{})"), "matrix 2x2\n    1  20\n  300   4\nvector of 0\n");
  const std::string large = b.run("local t = {} for i = 1, 41 do t[i] = {} for j = 1, 13 do t[i][j] = j end end print(matrix(t))");
  EXPECT_EQ(std::count(large.begin(), large.end(), '\n'), 1 + 40 + 2);
  EXPECT_EQ(large.find(" 13\n"), std::string::npos);
  EXPECT_NE(large.find("  (rows 41 to 41 are not shown; :csv(file) writes all)\n  (columns 13 to 13 are not shown"), std::string::npos)
      << large;
}

TEST(LuaMatrix, FilesHoldAllDigitsNamesAndUnits) {
  const fs::path folder = test::scratch("matrix");
  fs::remove_all(folder);
  LuaOptions options;
  options.output = folder;
  Bench b(std::move(options));
  b.run(
      "A = matrix({{1, 0.1}, {3, 1e-20}, {5, 6}}, {names = {'a', 'b', 'c, d'}}, {names = {'x', 'y'}, units = {'rad', 'm'}})"
      "A:csv('sub/a.csv') vector{1, 2}:csv('v.csv') A:hdf5('all.h5', 'first/A')"
      "vector({7, 8}, {names = {'p', 'q'}, units = {'N', 'm'}}):hdf5('all.h5', 'v') vector{9}:hdf5('all.h5', 'v2')");
  const auto text = [&](const char* name) {
    std::ifstream in(folder / name);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_EQ(text("sub/a.csv"), ",x [rad],y [m]\na,1,0.1\nb,3,1e-20\n\"c, d\",5,6\n");
  EXPECT_EQ(text("v.csv"), "1\n2\n");
  {
    const Hdf5File file = Hdf5File::open((folder / "all.h5").string());
    EXPECT_EQ(file.shape("/first/A"), (std::vector<std::size_t>{3, 2}));
    EXPECT_EQ(file.read_doubles("/first/A").values, (std::vector<double>{1, 0.1, 3, 1e-20, 5, 6})) << "row after row";
    EXPECT_EQ(file.texts_attribute("/first/A", "row_names"), (std::vector<std::string>{"a", "b", "c, d"}));
    EXPECT_EQ(file.texts_attribute("/first/A", "column_units"), (std::vector<std::string>{"rad", "m"}));
    EXPECT_EQ(file.texts_attribute("/v", "units"), (std::vector<std::string>{"N", "m"}));
    EXPECT_EQ(file.read_doubles("/v2").values, std::vector<double>{9});
  }
  b.run("vector{1, 2}:hdf5('all.h5', 'v')");
  EXPECT_FALSE(Hdf5File::open((folder / "all.h5").string()).has_attribute("/v", "names")) << "labels of what was there before";
  for (const char* name : {"../a.csv", "/a.csv", "", ".", "sub/../../a.csv", "sub"})
    EXPECT_NE(b.fault(std::string("vector{1}:csv('") + name + "')"), "no error") << name;
  EXPECT_NE(b.fault("vector{1}:hdf5('v.csv', 'x')"), "no error") << "no HDF5 file";
  EXPECT_EQ(Bench().fault("vector{1}:csv('a.csv')"),
            "a.csv | a place that can be written to | a script that writes no files; `cardan workbench` lets it");
  fs::remove_all(folder);
}

TEST(LuaMatrix, MemoryAndWorkCountForTheBudget) {
  LuaOptions options;
  options.memory_bytes = std::size_t{8} << 20;
  Bench b(std::move(options));
  b.run("t = {} for i = 1, 300 do t[i] = i end x = vector(t)");
  b.run("for i = 1, 100 do local A = x * 2 A = matrix{x:table()}:t() * matrix{x:table()} end");  // garbage is collected
  EXPECT_THROW(b.run("local all = {} for i = 1, 100 do all[i] = matrix{x:table()}:t() * matrix{x:table()} end"), InputError);
  EXPECT_THROW(
      b.host.run_text("test.lua", "local A = matrix{x:table()} local B = A:t() * A for i = 1, 1e9 do B = B * 1 end", {1'000'000, 60.0}),
      InputError);
}

TEST(LuaMatrix, BindingsPushAndReadThem) {
  Bench b;
  b.host.bind("swap", [](lua_State* L) {
    const Eigen::VectorXd x = to_vector(L, 1, 2, "the pair");
    push_vector(L, Eigen::Vector2d(x[1], x[0]), {{"first", "second"}, {"m", "s"}});
    const Eigen::MatrixXd A = to_matrix(L, 2, 1, 2, "the row");
    push_matrix(L, A.transpose(), {}, {{"only"}, {}});
    EXPECT_TRUE(is_vector(L, -2) && is_matrix(L, -1) && !is_matrix(L, -2));
    return 2;
  });
  EXPECT_EQ(b.run("local v, A = swap({1, 2}, {{3, 4}}) print(v['first'], v['second'], A(2, 'only'))"), "2.0\t1.0\t4.0\n");
  EXPECT_EQ(b.run("local v = swap(vector{1, 2}, matrix{{3, 4}}) print(v[1])"), "2.0\n");
  EXPECT_EQ(b.fault("swap({1, 2, 3}, {{1, 2}})"), "the pair | a vector or a table of 2 numbers | a table of 3");
  EXPECT_EQ(b.fault("swap(7, {{1, 2}})"), "the pair | a vector or a table of 2 numbers | 7 (number)");
  EXPECT_EQ(b.fault("swap(matrix{{1, 2}}, {{1, 2}})"), "the pair | a vector or a table of 2 numbers | a matrix 1x2");
  EXPECT_EQ(b.fault("swap({1, 2}, {{1, 2}, {3, 4}})"), "the row | a matrix 1x2 or a table of as many rows | a matrix 2x2");
}

TEST(LuaMatrix, SolvesAtTheEndsOfTheRangeOfNumbers) {
  Bench b;
  EXPECT_EQ(b.number("matrix{{1e-310}}:solve{1e-300}[1]"), 1e-300 / 1e-310);
  EXPECT_EQ(b.number("matrix{{5e-324}}:solve{5e-324}[1]"), 1.0);
  EXPECT_EQ(b.number("matrix{{1e300}}:solve{1e300}[1]"), 1.0);
  EXPECT_EQ(b.number("matrix{{5e-324, 0}, {0, 1e308}}:solve{1e-323, 1e308}[1]"), 2.0);
  EXPECT_EQ(b.fault("matrix{{1e-310}}:solve{1}"), "solve | a solution within the range of numbers | one that overflows");
}

TEST(LuaMatrix, ControllersMaySolveLargeSystems) {  // a Kalman filter of 200 states: some products and solves in one call
  Bench b;
  b.host.protect(
      [](lua_State* L) {
        const std::string text =
            "local n, rows = 200, {} for i = 1, n do rows[i] = {} for j = 1, n do rows[i][j] = i == j and n or math.sin(i * j) end end "
            "local P = matrix(rows) local x = P:solve(P) x = P * x * P:t() + P assert(P:solve(x * P):rows() == n)";
        if (luaL_loadbufferx(L, text.data(), text.size(), "@test.lua", "t") != LUA_OK) lua_error(L);
        lua_call(L, 0, 0);
      },
      kCallBudget);
}

TEST(LuaMatrix, WrapsToTheWindow) {
  LuaOptions options;
  std::size_t width = 30;
  options.width = [&width] { return width; };
  Bench b(std::move(options));
  const std::string make = "print(matrix({{1.25, 2.25, 3.25, 4.25, 5.25}, {1, 2, 3, 4, 5}}, {names = {'first', 'b'}}))";
  EXPECT_EQ(b.run(make),
            "matrix 2x5\n"
            " columns 1 to 3\n"
            "  first  1.25  2.25  3.25\n"
            "  b         1     2     3\n"
            " columns 4 to 5\n"
            "  first  4.25  5.25\n"
            "  b         4     5\n");
  width = 10;
  EXPECT_NE(b.run(make).find(" column 5\n  first  5.25\n"), std::string::npos);
  width = 0;
  EXPECT_EQ(b.run(make), "matrix 2x5\n  first  1.25  2.25  3.25  4.25  5.25\n  b         1     2     3     4     5\n");
}

TEST(LuaMatrix, WritesNothingOutsideOfItsFolder) {
  const fs::path folder = test::scratch("outside");
  fs::remove_all(folder);
  fs::create_directories(folder / "out");
  fs::create_symlink(folder / "target", folder / "out/d.csv");
  LuaOptions options;
  options.output = folder / "out";
  Bench b(std::move(options));
  EXPECT_EQ(b.fault("vector{1}:csv('d.csv')"), "d.csv | a place that can be written to | a symbolic link to a place where nothing is");
  EXPECT_FALSE(fs::exists(folder / "target"));
  b.run("vector{1}:hdf5('a.h5', 'x')");
  for (const char* name : {"x/z", ".", "..", "a/./b", "a//b", "", "a/", "a/../b"})
    EXPECT_NE(b.fault(std::string("vector{1}:hdf5('a.h5', '") + name + "')").find("the name of a dataset"), std::string::npos) << name;
  EXPECT_TRUE(b.run("print(vector{1}:csv('sub/m.csv'))").ends_with("out/sub/m.csv\n")) << "tells where it went";
  fs::remove_all(folder);
}

TEST(LuaMatrix, ArgumentsThatNobodyHearsAreRefused) {
  Bench b;
  EXPECT_EQ(b.fault("print(vector{3, -4}:norm(1))"), "norm | 0 arguments at most | 1") << "the 2-norm is all there is";
  EXPECT_EQ(b.fault("print(matrix{{1, 2}, {3, 4}}(1, 2, 3))").substr(0, 4), "a me") << "an entry has no name";
  EXPECT_EQ(b.fault("print(matrix{{2, 0}, {0, 2}}:solve({1, 1}, {1, 1}))"), "solve | 1 argument at most | 2");
  EXPECT_EQ(b.fault("vector({1}, {}, 2)"), "vector | 2 arguments at most | 3");
}

}  // namespace
}  // namespace cardan
