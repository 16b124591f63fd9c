// cardan-bench-factors: sparse symmetric factorisations with inertia counts, on the matrices that modes of finite-element
// models are found with, K - mu M with mu inside the spectrum: the one built in beside those of other libraries that are
// installed. Time and memory of the factor, time of a solve, backward error, negative pivots; a process for each.
#include <fmt/format.h>
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <ctime>
#include <fstream>
#include <functional>
#include <numbers>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "core/linalg/sparse_factor.hpp"
#ifdef CARDAN_BENCH_METIS
#include <Eigen/MetisSupport>
#endif
#ifdef CARDAN_BENCH_CHOLMOD
#include <Eigen/CholmodSupport>
#endif
#ifdef CARDAN_BENCH_MUMPS
#include <dmumps_c.h>
#endif

namespace cardan::bench {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Problem {
  SparseMatrix K, M;
  double mu = 0.0;
};

/// A cantilevered plate of aluminium, 4 x 1 m, as bodies/modal meshes it: six unknowns at each node.
Problem plate(double unknowns) {
  const int ny = static_cast<int>(std::lround(std::sqrt(unknowns / 6.0 / 4.0)));
  FeBuilder builder;
  const std::vector<int> edge = add_plate(builder, 0.0, 4.0, 1.0, 4 * ny, ny, plate_section(SolidPanel{{7e10, 0.3, 2700.0}, 0.005}, true));
  const FeModel mesh = builder.finish(edge, "");
  const FreePart free(mesh.n_dofs(), dofs_of(mesh.root_nodes));
  return {free.block(mesh.K), free.block(mesh.M), std::pow(2 * std::numbers::pi * 20.0, 2)};
}

/// A cantilevered block of aluminium, 2 x 1 x 1 m, of bricks with eight nodes (trilinear, 2 x 2 x 2 points), three
/// unknowns at each: what a mesh of solids costs.
Problem solid(double unknowns) {
  const int n = static_cast<int>(std::lround(std::cbrt(unknowns / 6.0))), nx = 2 * n;
  const double h = 1.0 / n, E = 7e10, nu = 0.3, rho = 2700.0;
  Eigen::Matrix<double, 6, 6> D = Eigen::Matrix<double, 6, 6>::Zero();
  D.topLeftCorner<3, 3>().setConstant(nu);
  D.diagonal() << 1 - nu, 1 - nu, 1 - nu, 0.5 - nu, 0.5 - nu, 0.5 - nu;
  D *= E / ((1 + nu) * (1 - 2 * nu));
  MatrixXd Ke = MatrixXd::Zero(24, 24), Me = MatrixXd::Zero(24, 24);
  for (int p = 0; p < 8; ++p) {
    const auto side = [](int i, int axis) { return (i >> axis) & 1 ? 1.0 : -1.0; };
    MatrixXd B = MatrixXd::Zero(6, 24), N = MatrixXd::Zero(3, 24);
    for (int c = 0; c < 8; ++c) {
      double value = 0.125;
      Eigen::Vector3d slope = Eigen::Vector3d::Constant(0.125 * 2.0 / h);
      for (int a = 0; a < 3; ++a) {
        const double factor = 1 + side(c, a) * side(p, a) / std::sqrt(3.0);
        value *= factor;
        for (int b = 0; b < 3; ++b) slope(b) *= a == b ? side(c, a) : factor;
      }
      for (int a = 0; a < 3; ++a) {
        const int i = (a + 1) % 3, j = (a + 2) % 3;
        N(a, 3 * c + a) = value, B(a, 3 * c + a) = slope(a);
        B(3 + a, 3 * c + i) = slope(j), B(3 + a, 3 * c + j) = slope(i);
      }
    }
    Ke += h * h * h / 8 * B.transpose() * D * B, Me += rho * h * h * h / 8 * N.transpose() * N;
  }
  const auto node = [&](int i, int j, int k) { return (i * (n + 1) + j) * (n + 1) + k; };
  std::vector<Eigen::Triplet<double>> K, M;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        for (int r = 0; r < 24; ++r)
          for (int s = 0; s < 24; ++s) {
            const auto dof = [&](int q) { return 3 * node(i + (q / 3 & 1), j + (q / 6 & 1), k + q / 12) + q % 3; };
            K.emplace_back(dof(r), dof(s), Ke(r, s)), M.emplace_back(dof(r), dof(s), Me(r, s));
          }
  const int size = 3 * (nx + 1) * (n + 1) * (n + 1);
  std::vector<int> held(static_cast<std::size_t>(3 * (n + 1) * (n + 1)));
  for (std::size_t i = 0; i < held.size(); ++i) held[i] = static_cast<int>(i);
  SparseMatrix full_K(size, size), full_M(size, size);
  full_K.setFromTriplets(K.begin(), K.end()), full_M.setFromTriplets(M.begin(), M.end());
  const FreePart free(size, held);
  return {free.block(full_K), free.block(full_M), std::pow(2 * std::numbers::pi * 1000.0, 2)};
}

/// [s] of the processor: what others run does not count.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// [bytes] a figure of /proc/self/status: VmRSS, what the process holds; VmHWM, the most since forget_peak().
double memory(const std::string& name) {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(name + ":")) return 1024.0 * std::stod(line.substr(name.size() + 1));
  return NAN;
}

void forget_peak() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << 5;
}

struct Factored {
  std::function<VectorXd(const VectorXd&)> solve;
  long negative = -1;  // pivots; -1: not told
  double entries = 0;  // of the factor; 0: not told
};

template <class Solver>
Factored by_eigen(const SparseMatrix& A) {
  const auto solver = std::make_shared<Solver>(A);
  return {[solver](const VectorXd& b) { return VectorXd(solver->solve(b)); }, (solver->vectorD().array() < 0.0).count(),
          static_cast<double>(solver->matrixL().nestedExpression().nonZeros())};
}

#ifdef CARDAN_BENCH_CHOLMOD
template <class Solver>
Factored by_cholmod(const SparseMatrix& A) {
  const auto solver = std::make_shared<Solver>();
  solver->compute(A);
  return {[solver](const VectorXd& b) { return VectorXd(solver->solve(b)); }, -1, solver->cholmod().lnz};
}
#endif

#ifdef CARDAN_BENCH_MUMPS
/// MUMPS for symmetric matrices, one process; `ordering` as ICNTL(7): 0 AMD, 3 SCOTCH, 4 PORD, 6 QAMD.
Factored by_mumps(const SparseMatrix& A, int ordering) {
  struct Data {
    DMUMPS_STRUC_C id{};
    std::vector<MUMPS_INT> row, column;
    std::vector<double> value;
  };
  const auto data = std::make_shared<Data>();
  for (int j = 0; j < A.outerSize(); ++j)
    for (SparseMatrix::InnerIterator it(A, j); it; ++it)
      if (it.row() >= j)
        data->row.push_back(static_cast<int>(it.row()) + 1), data->column.push_back(j + 1), data->value.push_back(it.value());
  DMUMPS_STRUC_C& id = data->id;
  id.job = -1, id.par = 1, id.sym = 2, id.comm_fortran = -987654;
  dmumps_c(&id);
  for (int i : {1, 2, 3, 4}) id.icntl[i - 1] = i == 4 ? 0 : -1;
  id.icntl[7 - 1] = ordering;
  id.n = static_cast<int>(A.rows()), id.nnz = static_cast<MUMPS_INT8>(data->value.size());
  id.irn = data->row.data(), id.jcn = data->column.data(), id.a = data->value.data();
  id.job = 4;
  dmumps_c(&id);
  if (id.infog[0] < 0) throw std::runtime_error(fmt::format("MUMPS {} {}", id.infog[0], id.infog[1]));
  const double entries = id.infog[9 - 1] < 0 ? -1e6 * id.infog[9 - 1] : id.infog[9 - 1];
  return {[data](const VectorXd& b) {
            VectorXd x = b;
            data->id.rhs = x.data(), data->id.nrhs = 1, data->id.lrhs = static_cast<int>(x.size()), data->id.job = 3;
            dmumps_c(&data->id);
            return x;
          },
          id.infog[12 - 1], entries};
}
#endif

/// Name, and what makes a factor of A.
const std::vector<std::pair<std::string, std::function<Factored(const SparseMatrix&)>>>& methods() {
  using Eigen::Lower;
  static const std::vector<std::pair<std::string, std::function<Factored(const SparseMatrix&)>>> all = {
      {"built in: " + SparseFactor::origin(),
       [](const SparseMatrix& A) {
         const auto factor = std::make_shared<SparseFactor>(A);
         return Factored{[factor](const VectorXd& b) { return VectorXd(factor->solve(b)); }, factor->negative_pivots()};
       }},
      {"Eigen simplicial, AMD", by_eigen<Eigen::SimplicialLDLT<SparseMatrix, Lower>>},
#ifdef CARDAN_BENCH_METIS
      {"Eigen simplicial, METIS", by_eigen<Eigen::SimplicialLDLT<SparseMatrix, Lower, Eigen::MetisOrdering<int>>>},
#endif
#ifdef CARDAN_BENCH_MUMPS
      {"MUMPS, AMD", [](const SparseMatrix& A) { return by_mumps(A, 0); }},
      {"MUMPS, SCOTCH", [](const SparseMatrix& A) { return by_mumps(A, 3); }},
      {"MUMPS, PORD", [](const SparseMatrix& A) { return by_mumps(A, 4); }},
#endif
#ifdef CARDAN_BENCH_CHOLMOD
      {"CHOLMOD simplicial", by_cholmod<Eigen::CholmodSimplicialLDLT<SparseMatrix, Lower>>},
      {"CHOLMOD supernodal L L*, of K", by_cholmod<Eigen::CholmodSupernodalLLT<SparseMatrix, Lower>>},
#endif
  };
  return all;
}

void measure(const std::string& shape, double unknowns, const std::string& name, const std::function<Factored(const SparseMatrix&)>& make) {
  const Problem p = shape == "plate" ? plate(unknowns) : solid(unknowns);
  SparseMatrix A = name.ends_with("of K") ? p.K : SparseMatrix(p.K - p.mu * p.M);
  A.prune(0.0, 0.0);  // for all alike, what ours does of itself
  forget_peak();
  const double held = memory("VmRSS"), begin = now();
  const Factored factor = make(A);
  const double factored = now();
  VectorXd b(A.rows());
  for (Eigen::Index i = 0; i < b.size(); ++i) b(i) = std::sin(static_cast<double>(i));
  const double before = now();
  const VectorXd x = factor.solve(b);
  const double solved = now();
  double norm = 0.0;
  for (int j = 0; j < A.outerSize(); ++j) norm = std::max(norm, A.col(j).cwiseAbs().sum());
  const double error = (A * x - b).lpNorm<Eigen::Infinity>() / (norm * x.lpNorm<Eigen::Infinity>() + b.lpNorm<Eigen::Infinity>());
  fmt::print("| {} | {} | {} | {:.3g} | {} | {:.3g} | {:.0f} | {:.1g} | {} |\n", shape, A.rows(), name, factored - begin,
             factor.entries > 0 ? fmt::format("{:.3g}", 1e-6 * factor.entries) : "-", 1e3 * (solved - before),
             1e-6 * (memory("VmHWM") - held), error, factor.negative < 0 ? "-" : fmt::format("{}", factor.negative));
  std::fflush(stdout);
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  using namespace cardan::bench;
  CLI::App app{"Sparse symmetric factorisations on matrices of finite-element models", "cardan-bench-factors"};
  std::vector<std::string> shapes = {"plate", "solid"};
  std::vector<double> sizes = {20000, 200000};
  std::string only;
  app.add_option("--shape", shapes, "plate, solid");
  app.add_option("--unknowns", sizes, "about so many");
  app.add_option("--only", only, "methods with this in their name");
  CLI11_PARSE(app, argc, argv);
  fmt::print(
      "| shape | unknowns | factor | CPU, s | entries, 1e6 | solve, ms | memory, MB | error | negative pivots "
      "|\n|---|---|---|---|---|---|---|---|---|\n");
  std::fflush(stdout);
  for (const std::string& shape : shapes)
    for (const double size : sizes)
      for (const auto& [name, make] : methods()) {
        if (name.find(only) == std::string::npos) continue;
        const pid_t child = fork();
        if (child == 0) {
          int status = 0;
          try {
            measure(shape, size, name, make);
          } catch (const std::exception& e) {
            fmt::print("| {} | {:g} | {} | {} | | | | | |\n", shape, size, name, e.what());
            status = 1;
          }
          std::fflush(stdout);
          _exit(status);
        }
        int status = 0;
        waitpid(child, &status, 0);
      }
}
