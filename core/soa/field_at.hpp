#pragma once
// The gravity field at a point: what an accelerometer there does not feel.
#include "core/soa/field_pull.hpp"

namespace cardan::soa {

/// [m/s^2] world axes, at the point `x` [m] of the world. `at`: Inputs::moment.
template <class T>
Vec3<T> field_at(const GravityField& field, const Vec3<T>& x, const FieldMoment* at) {
  using std::sqrt;
  if (field.source) return source_at(field, at, x);
  if (field.uniform) return {T(field.g.x), T(field.g.y), T(field.g.z)};
  if (!field.central) return {T(0.0), T(0.0), T(0.0)};
  const Vec3<T> r{x.x - T(field.centre.x), x.y - T(field.centre.y), x.z - T(field.centre.z)};
  const T r2 = dot(r, r);
  return T(-field.mu) / (r2 * sqrt(r2)) * r;
}

}  // namespace cardan::soa
