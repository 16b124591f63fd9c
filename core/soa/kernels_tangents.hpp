#pragma once
// The sweeps of inverse dynamics on numbers that carry their derivatives along eight directions (tangent.hpp), for each instruction set.
// Records of hinges: quaternions are differentiated in closed form, others by the slopes that built-in hinges tell (HingeSlopes) or by
// differences of eighth order, exact to 1e-14 for smooth hinge maps; then the rule of the chain, all directions at once. What bodies give
// along them is in kernels_tangent.cpp: direction by direction.
#include <algorithm>

#include "core/abi/registry.hpp"
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/tangent.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan::soa {

inline constexpr int kRecordNumbers = sizeof(cardan_hinge_out) / sizeof(double);
inline constexpr int kMostCoordinates = 64;  // of a hinge (core/abi/laws.cpp)

/// Coordinates and rates of a hinge that change along some direction, bit by bit.
struct Moves {
  std::uint64_t q = 0, v = 0;
};

/// Slopes of the record of a hinge that is no quaternion, in what moves, as HingeSlopes; `known` may be null. x, w: its values of q and v,
/// which move and come back.
void record_slopes(const cardan_hinge_family& f, HingeSlopes known, const void* packed, Moves moves, double* x, double* w,
                   cardan_hinge_out* in_q, double* in_v);
/// The parameters of hinge j of a batch.
CARDAN_INLINE const void* packed_of(const DenseBatch& batch, std::size_t j) {
  return reinterpret_cast<const std::byte*>(batch.packed.data()) + j * batch.family->params_size;
}

CARDAN_INLINE bool moves(const Tangent& a) { return a.d != 0.0; }
CARDAN_INLINE bool moves(const Tangents& a) {
  double any = 0.0;
  for (int d = 0; d < kDirections; ++d) any = a.d.x[d] != 0.0 ? 1.0 : any;
  return any != 0.0;
}
template <class T>
static Moves what_moves(const cardan_hinge_family& f, const T* q, const T* v) {
  Moves out;
  for (std::uint32_t i = 0; i < f.nq; ++i) out.q |= std::uint64_t{moves(q[i])} << i;
  for (std::uint32_t i = 0; i < f.nv; ++i) out.v |= std::uint64_t{moves(v[i])} << i;
  return out;
}

/// The records of a family by value; q and v by value stay in Workspace::family.
template <class T>
static void value_records(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const DenseBatch& batch) {
  double *q = ws.family.data(), *v = q + model.nq;
  for (int i = 0; i < model.nq; ++i) q[i] = in.q[i].x;
  for (int i = 0; i < model.nv; ++i) v[i] = in.v[i].x;
  batch.family->kinematics(batch.packed.data(), static_cast<std::uint32_t>(batch.iq.size()), batch.iq.data(), batch.iv.data(), q, v,
                           ws.hinge_records(0) + batch.first);
}

/// ball, free, free_body: set(k, number) of the numbers of the record that change: R of the quaternion, the position, and R* in the map of
/// `free`. Their rates of the map are not read.
template <class T, class Set>
static void quaternion_record(std::uint32_t shape, const T* q, const Set& set) {
  const Mat3<T> R = rotation_of_quaternion(q[0], q[1], q[2], q[3]);
  const T r[9] = {R.xx, R.xy, R.xz, R.yx, R.yy, R.yz, R.zx, R.zy, R.zz};
  for (int i = 0; i < 9; ++i) set(i, r[i]);
  if (shape == CARDAN_SHAPE_BALL) return;
  for (int i = 0; i < 3; ++i) set(9 + i, q[4 + i]);
  if (shape == CARDAN_SHAPE_FREE)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) set(12 + 6 * (3 + j) + 3 + i, r[3 * j + i]);
}

static inline void family_records(const SweepModel& model, Workspace<Tangents>& ws, const Inputs<Tangents>& in, const DenseBatch& batch) {
  value_records(model, ws, in, batch);
  double *q = ws.family.data(), *v = q + model.nq;
  const cardan_hinge_family& family = *batch.family;
  const int nq = static_cast<int>(family.nq), nv = static_cast<int>(family.nv);
  cardan_hinge_out in_q[kMostCoordinates];
  double in_v[36];
  for (std::size_t j = 0; j < batch.iq.size(); ++j) {
    const int record = batch.first + static_cast<int>(j);
    const Tangents *at = in.q + batch.iq[j], *rate = in.v + batch.iv[j];
    if (has_quaternion(family)) {
      for (int k = 0; k < 6 * nv; ++k) ws.set_hinge_number(record, 12 + k, ws.hinge_value(record, 12 + k));
      for (int k = 48; k < kRecordNumbers; ++k) ws.set_hinge_number(record, k, ws.hinge_value(record, k));
      for (int k = 9; k < 12; ++k) ws.set_hinge_number(record, k, ws.hinge_value(record, k));
      quaternion_record(family.shape, at, [&](int k, const Tangents& number) {
        ws.set_hinge_number(record, k, {ws.hinge_value(record, k), number.d});
      });
      continue;
    }
    const Moves moves = what_moves(family, at, rate);
    record_slopes(family, batch.slopes, packed_of(batch, j), moves, q + batch.iq[j], v + batch.iv[j], in_q, in_v);
    const auto chain = [&](int k) {
      Tangents number(ws.hinge_value(record, k));
      for (int c = 0; c < nq; ++c)
        if (moves.q >> c & 1) number.d = number.d + Lanes<kDirections>(reinterpret_cast<const double*>(in_q + c)[k]) * at[c].d;
      if (k >= 48)
        for (int c = 0; c < nv; ++c)
          if (moves.v >> c & 1) number.d = number.d + Lanes<kDirections>(in_v[6 * c + k - 48]) * rate[c].d;
      ws.set_hinge_number(record, k, number);
    };
    for (int k = 0; k < 12 + 6 * nv; ++k) chain(k);
    for (int k = 48; k < kRecordNumbers; ++k) chain(k);
  }
}

void family_inertia(const FlexibleBody& f, int m, const Tangents* eta, const Tangents* etadot, const Vec3<Tangents>& w,
                    Modal<Tangents>& modal, Tangents* M_rr);

}  // namespace cardan::soa
