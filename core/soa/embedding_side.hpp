#pragma once
// Bodies of one kernel side by side, one per lane (AlikeHinges): what stands body by body in the workspace as numbers of lanes, and back.
// One body: plain numbers.
#include <cstring>
#include <type_traits>

#include "core/model/gears.hpp"
#include "core/soa/embedding_work.hpp"
#include "core/soa/kernels_axis.hpp"

namespace cardan::soa {

template <int W>
using Side = std::conditional_t<W == 1, double, Lanes<W>>;

/// Numbers that stand side by side.
template <class T>
CARDAN_INLINE T side(const double* x) {
  if constexpr (kWidth<T> == 1) {
    return *x;
  } else {
    typename T::Pack a;
    std::memcpy(&a, x, sizeof a);
    return T(a);
  }
}
template <class T>
CARDAN_INLINE void set_side(double* x, const T& a) {
  if constexpr (kWidth<T> == 1)
    *x = a;
  else
    std::memcpy(x, &a.x, sizeof a.x);
}
/// number(i) of each lane.
template <class T, class Number>
CARDAN_INLINE T each(const Number& number) {
  if constexpr (kWidth<T> == 1)
    return number(0);
  else if constexpr (kWidth<T> == 2)
    return T(typename T::Pack{number(0), number(1)});
  else
    return T(typename T::Pack{number(0), number(1), number(2), number(3)});
}

#ifdef __clang__
#define CARDAN_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define CARDAN_SHUFFLE(a, b, ...) __builtin_shuffle(a, b, decltype((a) > (b)){__VA_ARGS__})
#endif
/// Rows to columns.
CARDAN_INLINE void transpose(Lanes<2>& a, Lanes<2>& b) {
  const auto x = a.x, y = b.x;
  a.x = CARDAN_SHUFFLE(x, y, 0, 2), b.x = CARDAN_SHUFFLE(x, y, 1, 3);
}
CARDAN_INLINE void transpose(Lanes<4>& a, Lanes<4>& b, Lanes<4>& c, Lanes<4>& d) {
  const auto x = CARDAN_SHUFFLE(a.x, b.x, 0, 4, 2, 6), y = CARDAN_SHUFFLE(a.x, b.x, 1, 5, 3, 7);
  const auto u = CARDAN_SHUFFLE(c.x, d.x, 0, 4, 2, 6), v = CARDAN_SHUFFLE(c.x, d.x, 1, 5, 3, 7);
  a.x = CARDAN_SHUFFLE(x, u, 0, 1, 4, 5), b.x = CARDAN_SHUFFLE(y, v, 0, 1, 4, 5);
  c.x = CARDAN_SHUFFLE(x, u, 2, 3, 6, 7), d.x = CARDAN_SHUFFLE(y, v, 2, 3, 6, 7);
}
#undef CARDAN_SHUFFLE

/// Where something of each body stands. Every number is named by itself below: a loop over them would go through memory.
template <class T>
struct Places {
  template <class At>
  CARDAN_INLINE explicit Places(const At& at) {
    p0 = at(0);
    if constexpr (kWidth < T >> 1) p1 = at(1);
    if constexpr (kWidth < T >> 2) p2 = at(2), p3 = at(3);
  }
  CARDAN_INLINE void take(int n, T& a) const {
    if constexpr (kWidth<T> == 1)
      a = p0[n];
    else if constexpr (kWidth<T> == 2)
      a = T(typename T::Pack{p0[n], p1[n]});
    else
      a = T(typename T::Pack{p0[n], p1[n], p2[n], p3[n]});
  }
  CARDAN_INLINE void take(int n, T& a, T& b) const {
    if constexpr (kWidth<T> == 2)
      a = side<T>(p0 + n), b = side<T>(p1 + n), transpose(a, b);
    else
      take(n, a), take(n + 1, b);
  }
  CARDAN_INLINE void take(int n, T& a, T& b, T& c, T& d) const {
    if constexpr (kWidth<T> == 4)
      a = side<T>(p0 + n), b = side<T>(p1 + n), c = side<T>(p2 + n), d = side<T>(p3 + n), transpose(a, b, c, d);
    else
      take(n, a, b), take(n + 2, c, d);
  }
  /// Sets or adds to it, body after body: two may stand at one place.
  template <bool ADD>
  CARDAN_INLINE void put(int n, const T& a) const {
    put_one<ADD>(p0 + n, lane(a, 0));
    if constexpr (kWidth < T >> 1) put_one<ADD>(p1 + n, lane(a, 1));
    if constexpr (kWidth < T >> 2) put_one<ADD>(p2 + n, lane(a, 2)), put_one<ADD>(p3 + n, lane(a, 3));
  }
  template <bool ADD>
  CARDAN_INLINE void put(int n, T a, T b) const {
    if constexpr (kWidth<T> == 2)
      transpose(a, b), put_one<ADD>(p0 + n, a), put_one<ADD>(p1 + n, b);
    else
      put<ADD>(n, a), put<ADD>(n + 1, b);
  }
  template <bool ADD>
  CARDAN_INLINE void put(int n, T a, T b, T c, T d) const {
    if constexpr (kWidth<T> == 4)
      transpose(a, b, c, d), put_one<ADD>(p0 + n, a), put_one<ADD>(p1 + n, b), put_one<ADD>(p2 + n, c), put_one<ADD>(p3 + n, d);
    else
      put<ADD>(n, a, b), put<ADD>(n + 2, c, d);
  }
  template <bool ADD, class Numbers>
  CARDAN_INLINE static void put_one(double* to, const Numbers& a) {
    set_side(to, ADD ? side<Numbers>(to) + a : a);
  }
  double *p0, *p1 = nullptr, *p2 = nullptr, *p3 = nullptr;
};
template <class T>
CARDAN_INLINE Places<T> P_of(Core<double>* const* cores) {
  return Places<T>([&](int i) { return &cores[i]->P.J.xx; });
}
template <class T>
CARDAN_INLINE Places<T> delta_of(Core<double>* const* cores) {
  return Places<T>([&](int i) { return &cores[i]->delta.w.x; });
}
template <class T>
CARDAN_INLINE Places<T> force_of(Force<double>* const* forces) {
  return Places<T>([&](int i) { return &forces[i]->n.x; });
}

template <class T>
CARDAN_INLINE void take_from(const Places<T>& at, ArticulatedInertia<T>& P) {
  at.take(0, P.J.xx, P.J.yy, P.J.zz, P.J.xy), at.take(4, P.J.xz, P.J.yz, P.B.xx, P.B.xy), at.take(8, P.B.xz, P.B.yx, P.B.yy, P.B.yz);
  at.take(12, P.B.zx, P.B.zy, P.B.zz, P.M.xx), at.take(16, P.M.yy, P.M.zz, P.M.xy, P.M.xz), at.take(20, P.M.yz);
}
template <class T>
CARDAN_INLINE void add_to(const Places<T>& at, const ArticulatedInertia<T>& P) {
  at.template put<true>(0, P.J.xx, P.J.yy, P.J.zz, P.J.xy), at.template put<true>(4, P.J.xz, P.J.yz, P.B.xx, P.B.xy);
  at.template put<true>(8, P.B.xz, P.B.yx, P.B.yy, P.B.yz), at.template put<true>(12, P.B.zx, P.B.zy, P.B.zz, P.M.xx);
  at.template put<true>(16, P.M.yy, P.M.zz, P.M.xy, P.M.xz), at.template put<true>(20, P.M.yz);
}
template <class T>
CARDAN_INLINE void take_from(const Places<T>& at, Force<T>& f) {
  at.take(0, f.n.x, f.n.y, f.n.z, f.f.x), at.take(4, f.f.y, f.f.z);
}
template <class T>
CARDAN_INLINE void add_to(const Places<T>& at, const Force<T>& f) {
  at.template put<true>(0, f.n.x, f.n.y, f.n.z, f.f.x), at.template put<true>(4, f.f.y, f.f.z);
}
template <class T>
CARDAN_INLINE void take_from(const Places<T>& at, Motion<T>& V) {
  at.take(0, V.w.x, V.w.y, V.w.z, V.v.x), at.take(4, V.v.y, V.v.z);
}
template <class T>
CARDAN_INLINE void set_at(const Places<T>& at, const Motion<T>& V) {
  at.template put<false>(0, V.w.x, V.w.y, V.w.z, V.v.x), at.template put<false>(4, V.v.y, V.v.z);
}

/// A force of each, as a record keeps it.
template <class T>
CARDAN_INLINE void set_aside(double (*to)[AlikeHinges::kMost], const Force<T>& f) {
  set_side(to[0], f.n.x), set_side(to[1], f.n.y), set_side(to[2], f.n.z);
  set_side(to[3], f.f.x), set_side(to[4], f.f.y), set_side(to[5], f.f.z);
}
template <class T>
CARDAN_INLINE Force<T> from_aside(const double (*from)[AlikeHinges::kMost]) {
  return {{side<T>(from[0]), side<T>(from[1]), side<T>(from[2])}, {side<T>(from[3]), side<T>(from[4]), side<T>(from[5])}};
}

/// Fours go as their halves where registers hold two numbers.
#ifdef __AVX__
constexpr int kMostAside = 4;
#else
constexpr int kMostAside = 2;
#endif
template <class Alike>
CARDAN_INLINE bool is_left_out(const Alike& all) {
  return kMostAside == 4 ? all.half : all.n > kMostAside;
}
/// visit<T>() with numbers of so many lanes.
template <class Visit>
CARDAN_INLINE auto side_by_side(int n, const Visit& visit) {
  if constexpr (kMostAside == 4)
    if (n == 4) return visit.template operator()<Lanes<4>>();
  return n == 2 ? visit.template operator()<Lanes<2>>() : visit.template operator()<double>();
}

/// What the kernels read of the hinges.
template <class T>
struct HingesAside {
  CARDAN_INLINE explicit HingesAside(const AlikeHinges& h)
      : cos_alpha(side<T>(h.cos_alpha)),
        sin_alpha(side<T>(h.sin_alpha)),
        cos_beta(side<T>(h.cos_beta)),
        sin_beta(side<T>(h.sin_beta)),
        l{side<T>(h.l[0]), side<T>(h.l[1])} {}
  T cos_alpha, sin_alpha, cos_beta, sin_beta, l[2];
};
template <class T>
CARDAN_INLINE T cosine_of(const Workspace<double>& ws, const AlikeHinges& h) {
  return each<T>([&](int i) { return ws.cosines[h.angle[i]]; });
}
template <class T>
CARDAN_INLINE T sine_of(const Workspace<double>& ws, const AlikeHinges& h) {
  return each<T>([&](int i) { return ws.sines[h.angle[i]]; });
}

/// The first lane in which a pivot is no inertia: Workspace::breakdown.
template <class T>
static void break_down(Workspace<double>& ws, const AlikeHinges& h, const T& D, const T& limit) {
  int i = 0;
  while (i + 1 < kWidth<T> && lane(D, i) > lane(limit, i)) ++i;
  ws.breakdown = {h.body[i], 0, lane(D, i), lane(limit, i)};
}

}  // namespace cardan::soa
