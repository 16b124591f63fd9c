#pragma once
// The laws of hinge loads, each once, on doubles and on numbers with a derivative: forces, energies and tangents of all that uses them.
// docs/mathematics/hinges.md, "Springs, stops, friction".
#include <algorithm>
#include <cmath>

#include "core/model/model.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::hinge_laws {

using std::exp, std::pow, std::tanh;

/// What a stop pushes with, d > 0 deep at the rate d': stiffness d^exponent (1 + dissipation d'), never a pull
/// [Hunt & Crossley 1975, J. Applied Mechanics 42].
template <class T>
T contact(const HingeLoad::Parameters& p, const T& depth, const T& rate) {
  const T factor = T(1.0) + T(p[4]) * rate;
  return factor > T(0.0) ? T(p[2]) * pow(depth, p[3]) * factor : T(0.0);
}

/// The generalised force on the component at q, v.
template <class T>
T force(const HingeLoad& load, const T& q, const T& v) {
  const HingeLoad::Parameters& p = load.p;
  switch (load.law) {
    case HingeLaw::spring:
      return -(T(p[0]) * (q - T(p[1])) + T(p[2]) * v);
    case HingeLaw::stop:
      if (q > T(p[1])) return -contact<T>(p, q - T(p[1]), v);
      if (q < T(p[0])) return contact<T>(p, T(p[0]) - q, -v);
      return T(0.0);
    case HingeLaw::friction: {
      const T s = v / T(p[2]);
      return -((T(p[0]) + T(p[1] - p[0]) * exp(-(s * s))) * tanh(v / T(p[4])) + T(p[3]) * v);
    }
  }
  return T(0.0);
}

/// What it holds at q; its force at rest is minus the derivative of that.
inline double energy(const HingeLoad& load, double q) {
  const HingeLoad::Parameters& p = load.p;
  if (load.law == HingeLaw::spring) return 0.5 * p[0] * (q - p[1]) * (q - p[1]);
  if (load.law == HingeLaw::friction) return 0.0;
  const double depth = std::max({q - p[1], p[0] - q, 0.0});
  return p[2] * std::pow(depth, p[3] + 1.0) / (p[3] + 1.0);
}

/// -df/dq and -df/dv at q, v.
struct Linear {
  double stiffness, damping;
};
inline Linear linear(const HingeLoad& load, double q, double v) {
  return {-force<Tangent>(load, {q, 1.0}, v).d, -force<Tangent>(load, q, {v, 1.0}).d};
}

/// tau += the forces of all loads of the model; q, v, tau in the user's order.
template <class T>
void add_forces(const Model& model, const T* q, const T* v, T* tau) {
  for (const HingeLoad& load : model.loads) tau[load.v] = tau[load.v] + force<T>(load, q[load.q], v[load.v]);
}

}  // namespace cardan::hinge_laws
