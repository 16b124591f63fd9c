#include "bodies/modal/matrix_market.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>
#include <vector>

namespace cardan {
namespace {

constexpr double kSymmetric = 1e-9;      // of the diagonal entries of its row and column, where an entry may differ from its mirror image
constexpr std::size_t kMostBytes = 200;  // bytes of a line that is read
constexpr long long kMostEntries = 1e8;

class MatrixText {
 public:
  MatrixText(const std::string& path, const Located& at) : path_(path), at_(at), in_(path) {
    if (!in_) cardan::refuse(Code::file_not_found, at, "a file in the Matrix Market format", "no file that can be read at " + path);
  }

  SparseMatrix read(int n) {
    next("a header");
    std::istringstream words(line_);
    std::string banner, object, form, field, symmetry;
    words >> banner >> object >> form >> field >> symmetry;
    if (banner != "%%MatrixMarket" || object != "matrix" || form != "coordinate" || (field != "real" && field != "integer") ||
        (symmetry != "symmetric" && symmetry != "general"))
      refuse("%%MatrixMarket matrix coordinate real symmetric (or general)", line_);
    const bool one_half = symmetry == "symmetric";
    do next("rows, columns and the number of entries");
    while (line_.empty() || line_[0] == '%');
    const std::vector<double> sizes = numbers(3, "rows, columns and the number of entries");
    if (sizes[0] != n || sizes[1] != n) refuse(fmt::format("{} rows and columns: six for each node", n), line_);
    if (!(sizes[2] >= 0 && sizes[2] <= kMostEntries)) refuse(fmt::format("at most {} entries", kMostEntries), line_);
    std::vector<Eigen::Triplet<double>> entries;
    for (auto left = static_cast<long long>(sizes[2]); left > 0; --left) {
      next(fmt::format("{} more entries", left));
      const std::vector<double> e = numbers(3, "row, column, value");
      const auto whole = [&](double x) { return x >= 1 && x <= n && x == std::floor(x); };
      if (!whole(e[0]) || !whole(e[1])) refuse(fmt::format("a row and a column from 1 to {}", n), line_);
      const int i = static_cast<int>(e[0]) - 1, j = static_cast<int>(e[1]) - 1;
      if (one_half && i < j) refuse("the lower triangle of a symmetric matrix", line_);
      entries.emplace_back(i, j, e[2]);
      if (one_half && i != j) entries.emplace_back(j, i, e[2]);
    }
    SparseMatrix A(n, n);
    A.setFromTriplets(entries.begin(), entries.end());
    return symmetric(A);
  }

 private:
  void next(const std::string& expected) {
    if (!std::getline(in_, line_)) refuse(expected, "the end of the file");
    ++number_;
    if (!line_.empty() && line_.back() == '\r') line_.pop_back();
    if (line_.size() > kMostBytes) line_.resize(kMostBytes);
  }

  std::vector<double> numbers(std::size_t count, const char* what) {
    std::vector<double> out;
    const char *p = line_.data(), *end = p + line_.size();
    while (true) {
      while (p != end && (*p == ' ' || *p == '\t')) ++p;
      if (p == end) break;
      if (*p == '+') ++p;  // which from_chars does not know
      double x = 0.0;
      const auto [after, error] = std::from_chars(p, end, x);
      if (error != std::errc() || !std::isfinite(x) || (after != end && *after != ' ' && *after != '\t')) refuse(what, line_);
      out.push_back(x);
      p = after;
    }
    if (out.size() != count) refuse(what, line_);
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
    cardan::refuse(Code::bad_modal_data, {at_.key_path, {path_, number_, 0}}, std::move(expected), std::move(got));
  }

  const std::string& path_;
  const Located& at_;
  std::ifstream in_;
  std::string line_;
  int number_ = 0;
};

}  // namespace

SparseMatrix read_symmetric_matrix(const std::string& path, int n, const Located& at) { return MatrixText(path, at).read(n); }

}  // namespace cardan
