#pragma once
// Gravity that is a field of a family, on a body: force, torque and potential energy of a rigid inertia from a, da/dr and U at its mass
// centre (docs/mathematics/gravity.md 5). Families know doubles: other scalars are served lane by lane, Tangent by differences.
#include <type_traits>

#include "core/model/sweep_model.hpp"
#include "core/soa/tangent.hpp"
#include "core/spatial/inertia.hpp"

namespace cardan::soa {

/// A field at n points: values and, unless null, their gradients, by differences of eighth order where the family has none of its own. The
/// codes of all calls and of the moment, or-ed.
int ask_field(const FieldSource& field, const FieldMoment& when, int n, const double* points, double* values, double* gradients);

/// On a body, about its mass centre, in the axes of the body.
template <class T>
struct FieldPull {
  Vec3<T> force, torque;  // [N], [N m]
  Mat3<T> gradient;       // [1/s^2] da/dr; 0 where GravityField::gradient is not wanted
  T potential;            // [J]
};

namespace detail {

/// The lanes of a Tangent, or of Tangents, after the first.
template <class T>
static constexpr bool is_derivative(int lane) {
  return (std::is_same_v<T, Tangent> || std::is_same_v<T, Tangents>)&&lane > 0;
}

/// What a body is to a field, world axes: m, its mass centre (3), and its second moments about it xx yy zz xy xz yz [kg m^2].
inline constexpr int kBodyNumbers = 10;
/// Force, torque, gradient (by rows), potential energy.
inline constexpr int kPullNumbers = 16;
void pull(const GravityField& g, const FieldMoment* at, const double* body, double* out);
/// d out along d body, of eighth order in the length over which the field varies.
void pull_along(const GravityField& g, const FieldMoment* at, const double* body, const double* rate, double* out);
/// a [m/s^2] and by rows da/dr at a point.
void acceleration(const GravityField& g, const FieldMoment* at, const double* point, double* a, double* gradient);

}  // namespace detail

/// m, c [m] from the origin of the body and J [kg m^2] about c in body axes.
template <class T>
static FieldPull<T> field_pull(const GravityField& g, const FieldMoment* at, const T& m, const Vec3<T>& c, const Sym3<T>& J,
                               const Pose<T>& body_W) {
  const Mat3<T>& R = body_W.R;
  const Vec3<T> x = body_W.p + R * c;
  const T half = T(0.5) * (J.xx + J.yy + J.zz);
  const Mat3<T> S = R * Mat3<T>{half - J.xx, -J.xy, -J.xz, -J.xy, half - J.yy, -J.yz, -J.xz, -J.yz, half - J.zz} * transpose(R);
  const T in[detail::kBodyNumbers] = {m, x.x, x.y, x.z, S.xx, S.yy, S.zz, S.xy, S.xz, S.yz};
  T out[detail::kPullNumbers];
  double one[detail::kBodyNumbers], given[detail::kPullNumbers];
  if constexpr (std::is_same_v<T, double>) {
    detail::pull(g, at, in, out);
  } else {
    for (int l = 0; l < kWidth<T>; ++l) {
      double rate[detail::kBodyNumbers];
      for (int i = 0; i < detail::kBodyNumbers; ++i) (detail::is_derivative<T>(l) ? rate : one)[i] = lane(in[i], l);
      if (detail::is_derivative<T>(l))
        detail::pull_along(g, at, one, rate, given);
      else
        detail::pull(g, at, one, given);
      for (int i = 0; i < detail::kPullNumbers; ++i) set_lane(out[i], l, given[i]);
    }
  }
  const Mat3<T> G{out[6], out[7], out[8], out[9], out[10], out[11], out[12], out[13], out[14]};
  return {transpose_times(R, Vec3<T>{out[0], out[1], out[2]}), transpose_times(R, Vec3<T>{out[3], out[4], out[5]}), transpose(R) * G * R,
          out[15]};
}

/// [m/s^2] world axes.
template <class T>
static Vec3<T> source_at(const GravityField& g, const FieldMoment* at, const Vec3<T>& x) {
  Vec3<T> out{T(0), T(0), T(0)};
  const T in[3] = {x.x, x.y, x.z};
  double a[3], G[9], point[3];
  for (int l = 0; l < kWidth<T>; ++l) {
    if (detail::is_derivative<T>(l)) {
      for (int i = 0; i < 3; ++i) a[i] = G[3 * i] * lane(in[0], l) + G[3 * i + 1] * lane(in[1], l) + G[3 * i + 2] * lane(in[2], l);
    } else {
      for (int i = 0; i < 3; ++i) point[i] = lane(in[i], l);
      detail::acceleration(g, at, point, a, G);
    }
    set_lane(out.x, l, a[0]), set_lane(out.y, l, a[1]), set_lane(out.z, l, a[2]);
  }
  return out;
}

}  // namespace cardan::soa
