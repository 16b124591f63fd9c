#pragma once
// Inertias by their mass centres, for the refinement of v' where masses grow by large ratios per link (core/soa/kernels_refine.hpp).
// Steps of assemble().
#include <numeric>
#include <span>

#include "core/model/model.hpp"

namespace cardan {

/// Which elements of a list stand under each number 0 ... n - 1 that their member gives, in order.
class Groups {
 public:
  template <class T>
  Groups(const std::vector<T>& list, int T::*key, int n) : first_(static_cast<std::size_t>(n) + 1, 0), members_(list.size()) {
    for (const T& x : list) ++first_[static_cast<std::size_t>(x.*key) + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<int> next = first_;
    for (std::size_t i = 0; i < list.size(); ++i) members_[next[list[i].*key]++] = static_cast<int>(i);
  }
  std::span<const int> operator[](int k) const {
    return {members_.begin() + first_[k], members_.begin() + first_[static_cast<std::size_t>(k) + 1]};
  }

 private:
  std::vector<int> first_, members_;  // those of k: members_[first_[k]] ... members_[first_[k + 1] - 1]
};

using Long = long double;
using Mat3L = Eigen::Matrix<Long, 3, 3>;
using Vec3L = Eigen::Matrix<Long, 3, 1>;

/// CentralInertia on its way through frames: turned, moved and merged it is what it was, a particle stays one.
struct Central {
  Long m = 0;
  Vec3L c = Vec3L::Zero();
  Mat3L S = Mat3L::Zero();

  static Central of(const BodySpec& b) {
    Central out{b.mass, b.com.cast<Long>(), Mat3L::Zero()};
    Mat3L J = b.inertia_com.cast<Long>();
    if (b.modal) {
      const ModalIntegrals& I = b.modal->integrals;
      out.m = I.I1;
      out.c = I.I2.cast<Long>() / out.m;
      J = I.I7.cast<Long>() - out.m * (out.c.squaredNorm() * Mat3L::Identity() - out.c * out.c.transpose());
    }
    out.S = J.trace() / 2 * Mat3L::Identity() - J;
    return out;
  }
  Central in(const Pose<double>& X) const {
    const Mat3L R = to_eigen(X.R).cast<Long>();
    return {m, R * c + to_eigen(X.p).cast<Long>(), R * S * R.transpose()};
  }
  void operator+=(const Central& b) {
    if (m == 0) return void(*this = b);
    const Vec3L d = b.c - c;
    S += b.S + m * b.m / (m + b.m) * d * d.transpose();
    c += b.m / (m + b.m) * d;
    m += b.m;
  }
  CentralInertia down() const {
    const Eigen::Matrix3d s = S.cast<double>();
    return {static_cast<double>(m), from_eigen(Eigen::Vector3d(c.cast<double>())), symmetric(s)};
  }
};

/// Per sweep body, before frames are chosen. `order`: of the user's bodies, inboard before outboard.
std::vector<Central> central_inertias(const Model& model, std::span<const int> order);

/// A light body between two heavy ones feels their tension along the line between its hinges, p x f with f along p. Where its
/// inboard hinge lets it turn about that line (a ball), rounding of this couple would turn it: hence a frame whose x axis is p of the
/// heaviest outboard part, in which the component is exactly zero.
void turn_dense_frames(Model& model, std::vector<Central>& central);

/// As the sweeps read them, in the frames chosen.
void keep_central_inertias(Model& model, std::vector<Central> central);

}  // namespace cardan
