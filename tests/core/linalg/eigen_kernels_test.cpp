// Products that are compiled once, against sums written out: every way in which an operand or a result may stand in memory.
#include "core/linalg/eigen_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

MatrixXd product(const MatrixXd& A, const MatrixXd& B) {
  MatrixXd C = MatrixXd::Zero(A.rows(), B.cols());
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    for (Eigen::Index j = 0; j < B.cols(); ++j)
      for (Eigen::Index k = 0; k < A.cols(); ++k) C(i, j) += A(i, k) * B(k, j);
  return C;
}

struct EigenKernels : testing::Test {
  std::mt19937_64 rng{3};
  MatrixXd any(Eigen::Index rows, Eigen::Index cols) {
    std::normal_distribution<double> d;
    return MatrixXd::NullaryExpr(rows, cols, [&] { return d(rng); });
  }
  void near(const MatrixXd& is, const MatrixXd& should, const char* what) {
    ASSERT_EQ(is.rows(), should.rows()) << what;
    ASSERT_EQ(is.cols(), should.cols()) << what;
    EXPECT_LE((is - should).norm(), 1e-14 * (1.0 + should.norm()) * std::sqrt(1.0 + static_cast<double>(is.size()))) << what;
  }
};

TEST_F(EigenKernels, MultiplyWhateverStandsInMemory) {
  // On both sides of the size from which Eigen multiplies by blocks, and of one row, one column, none.
  for (const auto [m, k, n] : {std::array<int, 3>{5, 4, 3}, {30, 41, 23}, {1, 30, 20}, {20, 30, 1}, {1, 30, 1}, {25, 0, 25}, {0, 5, 4}}) {
    SCOPED_TRACE(testing::Message() << m << " " << k << " " << n);
    const MatrixXd A = any(m, k), B = any(k, n), C = any(m, n), big = any(m + 3, k + 5), At = A.transpose(), Bt = B.transpose();
    const RowMajor R = A, S = B;
    const MatrixXd AB = product(A, B);
    MatrixXd Y;
    Y = A * B, near(Y, AB, "A B");
    Y = At.transpose() * B, near(Y, AB, "transposed left");
    Y = A * Bt.transpose(), near(Y, AB, "transposed right");
    Y = At.transpose() * Bt.transpose(), near(Y, AB, "transposed both");
    Y = R * B, near(Y, AB, "row-major left");
    Y = R * S, near(Y, AB, "row-major both");
    Y = R.transpose().transpose() * S, near(Y, AB, "turned twice");
    Y = big.block(2, 3, m, k) * B, near(Y, product(big.block(2, 3, m, k), B), "a block");
    Y = (2.0 * A) * (-B), near(Y, -2.0 * AB, "factors on both sides");
    Y = (A + A) * B, near(Y, 2.0 * AB, "a sum");
    Y = A * B * Bt, near(Y, product(AB, Bt), "three");
    Y = C, Y += A * B, near(Y, C + AB, "added");
    Y = C, Y -= A * B, near(Y, C - AB, "subtracted");
    Y = C, Y.noalias() -= 3.0 * A * B, near(Y, C - 3.0 * AB, "three times, in place");
    RowMajor Z = A * B;
    near(Z, AB, "into rows");
    Z.noalias() += A * Bt.transpose(), near(Z, 2.0 * AB, "added to rows");
    MatrixXd wide = MatrixXd::Zero(m + 2, n + 2);
    wide.block(1, 1, m, n) = A * B, near(wide.block(1, 1, m, n), AB, "into a block");
    EXPECT_EQ(wide.row(0).norm() + wide.row(m + 1).norm() + wide.col(0).norm() + wide.col(n + 1).norm(), 0.0);
    wide.transpose().block(1, 1, n, m) = Bt * At, near(wide.block(1, 1, m, n), AB, "into a transposed block");
    std::vector<double> spread(static_cast<std::size_t>(2 * m * n + 1), 7.0);
    Eigen::Map<MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, 2>> every_other(spread.data(), m, n, {2 * m, 2});
    every_other = A * B, near(every_other, AB, "into every other number");
    for (std::size_t i = 1; i < spread.size(); i += 2) ASSERT_EQ(spread[i], 7.0);
    std::vector<int> rows(static_cast<std::size_t>(m));
    for (int i = 0; i < m; ++i) rows[static_cast<std::size_t>(i)] = m - 1 - i;
    MatrixXd turned = C;
    turned(rows, Eigen::all) += A * B, near(turned(rows, Eigen::all), C(rows, Eigen::all) + AB, "into rows by a list");
    Y = A(rows, Eigen::all) * B, near(Y, AB(rows, Eigen::all), "of rows by a list");
    if (m == n && m == k) continue;
    MatrixXd same = any(m, m);
    const MatrixXd before = same;
    same = same * same, near(same, product(before, before), "what is read is written");
  }
}

TEST_F(EigenKernels, MultiplyVectors) {
  for (const auto [m, n] : {std::array<int, 2>{4, 3}, {40, 31}, {1, 25}, {25, 1}, {6, 0}}) {
    SCOPED_TRACE(testing::Message() << m << " " << n);
    const MatrixXd A = any(m, n), At = A.transpose(), wide = any(n + 2, 5), tall = any(3, n + 1);
    const RowMajor R = A;
    const VectorXd x = any(n, 1), u = any(m, 1), b = any(m, 1);
    const VectorXd Ax = product(A, x), Au = product(At, u);
    VectorXd y;
    y = A * x, near(y, Ax, "A x");
    y = R * x, near(y, Ax, "row-major");
    y = At.transpose() * x, near(y, Ax, "transposed");
    y = A.transpose() * u, near(y, Au, "of the transposed");
    y = b, y += A * x, near(y, b + Ax, "added");
    y = b, y -= 2.0 * A * (-x), near(y, b + 2.0 * Ax, "subtracted, with factors");
    y = b - A * x, near(y, b - Ax, "a difference");
    y = A * (x + x), near(y, 2.0 * Ax, "a sum");
    y = (A + A) * x, near(y, 2.0 * Ax, "of a sum");
    y = A * wide.col(2).segment(1, n), near(y, product(A, wide.col(2).segment(1, n)), "a column");
    y = A * tall.row(1).segment(1, n).transpose(), near(y, product(A, tall.row(1).segment(1, n).transpose()), "a row, numbers apart");
    Eigen::RowVectorXd row = u.transpose() * A;
    near(row, Au.transpose(), "from the left");
    row = tall.row(2).segment(0, n) * At, near(row, product(tall.row(2).segment(0, n), At), "a row from the left");
    MatrixXd into = MatrixXd::Zero(3, m);
    into.row(1) = (A * x).transpose(), near(into.row(1), Ax.transpose(), "into a row, numbers apart");
    into.row(1) += x.transpose() * At, near(into.row(1), 2.0 * Ax.transpose(), "added to a row");
    EXPECT_EQ(into.row(0).norm() + into.row(2).norm(), 0.0);
    MatrixXd columns = MatrixXd::Zero(m, 3);
    columns.col(2).noalias() += A * x, near(columns.col(2), Ax, "into a column");
  }
}

}  // namespace
}  // namespace cardan::test
