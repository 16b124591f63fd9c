#include "bodies/modal/matrix_market.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <sstream>
#include <vector>

#include "bodies/modal/text_lines.hpp"

namespace cardan {
namespace {

constexpr double kSymmetric = 1e-9;  // of the diagonal entries of its row and column, where an entry may differ from its mirror image
constexpr long long kMostEntries = 1e8;

class MatrixText {
 public:
  MatrixText(const std::string& path, const Located& at) : path_(path), at_(at), lines_(path, at, "a file in the Matrix Market format") {}

  SparseMatrix read(int nodes, std::initializer_list<int> per_node, int more) {
    next("a header");
    std::istringstream words(lines_.line());
    std::string banner, object, form, field, symmetry;
    words >> banner >> object >> form >> field >> symmetry;
    if (banner != "%%MatrixMarket" || object != "matrix" || form != "coordinate" || (field != "real" && field != "integer") ||
        (symmetry != "symmetric" && symmetry != "general"))
      refuse("%%MatrixMarket matrix coordinate real symmetric (or general)", lines_.line());
    const bool one_half = symmetry == "symmetric";
    do next("rows, columns and the number of entries");
    while (lines_.line().empty() || lines_.line()[0] == '%');
    const Three sizes = numbers("rows, columns and the number of entries");
    int n = 0;
    std::string expected;
    for (const int k : per_node) {
      const int rows = k * nodes + more;
      if (sizes[0] == rows && sizes[1] == rows) n = rows;
      expected += fmt::format("{}{} rows and columns: {} for each node", expected.empty() ? "" : ", or ", rows, k == 6 ? "six" : "three");
    }
    if (more > 0) expected += fmt::format(", and {} of component modes", more);
    if (n == 0) refuse(expected, lines_.line());
    if (!(sizes[2] >= 0 && sizes[2] <= kMostEntries)) refuse(fmt::format("at most {} entries", kMostEntries), lines_.line());
    std::vector<Eigen::Triplet<double>> entries;
    for (auto left = static_cast<long long>(sizes[2]); left > 0; --left) {
      if (!lines_.next()) refuse(fmt::format("{} more entries", left), "the end of the file");
      const Three e = numbers("row, column, value");
      const auto whole = [&](double x) { return x >= 1 && x <= n && x == std::floor(x); };
      if (!whole(e[0]) || !whole(e[1])) refuse(fmt::format("a row and a column from 1 to {}", n), lines_.line());
      const int i = static_cast<int>(e[0]) - 1, j = static_cast<int>(e[1]) - 1;
      if (one_half && i < j) refuse("the lower triangle of a symmetric matrix", lines_.line());
      entries.emplace_back(i, j, e[2]);
      if (one_half && i != j) entries.emplace_back(j, i, e[2]);
    }
    while (lines_.next())
      if (const std::string& rest = lines_.line(); rest.find_first_not_of(" \t") != std::string::npos && rest[0] != '%')
        refuse(fmt::format("{:.0f} entries, as the line of sizes says", sizes[2]), rest);
    SparseMatrix A(n, n);
    A.setFromTriplets(entries.begin(), entries.end());
    return symmetric(A);
  }

 private:
  using Three = std::array<double, 3>;

  void next(const char* expected) {
    if (!lines_.next()) refuse(expected, "the end of the file");
  }

  Three numbers(const char* what) {
    const std::string& line = lines_.line();
    const char *p = line.data(), *const end = p + line.size();
    const auto skip = [&] {
      while (p != end && (*p == ' ' || *p == '\t')) ++p;
    };
    Three out{};
    for (double& x : out) {
      skip();
      if (p != end && *p == '+') ++p;  // which from_chars does not know
      const auto [after, error] = std::from_chars(p, end, x);
      if (error != std::errc() || !std::isfinite(x) || (after != end && *after != ' ' && *after != '\t')) refuse(what, line);
      p = after;
    }
    skip();
    if (p != end) refuse(what, line);
    return out;
  }

  /// The mean of A and A*, where they are the same but for rounding.
  SparseMatrix symmetric(const SparseMatrix& A) {
    const SparseMatrix mirror = A.transpose(), difference = A - mirror;
    const Eigen::VectorXd diagonal = A.diagonal().cwiseAbs().cwiseSqrt();
    for (int j = 0; j < difference.outerSize(); ++j)
      for (SparseMatrix::InnerIterator d(difference, j); d; ++d) {
        const int i = static_cast<int>(d.row());
        if (std::abs(d.value()) > kSymmetric * diagonal[i] * diagonal[j])
          cardan::refuse(Code::bad_modal_data, {at_.key_path, {path_}}, "a symmetric matrix",
                         fmt::format("{:.9g} in row {}, column {}, and {:.9g} in row {}, column {}", A.coeff(i, j), i + 1, j + 1,
                                     A.coeff(j, i), j + 1, i + 1));
      }
    return 0.5 * (A + mirror);
  }

  [[noreturn]] void refuse(std::string expected, std::string got) const {
    cardan::refuse(Code::bad_modal_data, lines_.here(), std::move(expected), std::move(got));
  }

  const std::string& path_;
  const Located& at_;
  TextLines lines_;
};

}  // namespace

SparseMatrix read_symmetric_matrix(const std::string& path, int nodes, std::initializer_list<int> per_node, int more, const Located& at) {
  return MatrixText(path, at).read(nodes, per_node, more);
}

}  // namespace cardan
