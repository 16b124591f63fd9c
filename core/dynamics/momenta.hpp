#pragma once
// Generalised momenta p = M(q) v and what their rates have of the motion itself: what methods that integrate (q, p) ask of a vehicle.
// docs/mathematics/variational.md, 2.
#include <vector>

#include "core/dynamics/inverse.hpp"

namespace cardan {

class Momenta {
 public:
  explicit Momenta(const Model& model);

  /// p = M v and rate = (dM/dt) v - C(q, v), nv each, in O(N): of the kinetic energy T, for coordinates with q' = v, rate = dT/dq at
  /// constant v; for the angular velocity of quaternion hinges what p' is where nothing acts and v' = 0. Two sweeps and a pass over the
  /// bodies; no velocity terms are formed. Open trees; allocates nothing.
  void at(Workspace& workspace, const double* q, const double* v, double* p, double* rate);

 private:
  /// A hinge whose map H* depends on its coordinates, which are the integrals of its rates.
  struct Curved {
    const UserBody* user;
    bool turned;  // the frame of the body is S, not P
    Mat3<double> R_PS;
  };
  void of_hinge(const Workspace& workspace, int body, const double* q, const double* v, double* rate);
  void of_inertia(const Workspace& workspace, int body, const double* q, const double* v, double* rate);

  const Model& model_;
  std::vector<int> curved_of_;  // per sweep body: index into curved_, -1 where H* is constant in P or the hinge has a quaternion
  std::vector<Curved> curved_;
  std::vector<std::uint8_t> linear_;         // per sweep body: M_re and M_ee are linear in eta
  std::vector<double> ahead_, back_, work_;  // M_fl(eta) at displaced eta: M_rr, M_re, M_ee
};

}  // namespace cardan
