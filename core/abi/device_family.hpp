#pragma once
// From a C++ device (a struct of static functions, checked by a concept) to the C table of cardan_device.h. Its law is a template on the
// scalar: on Tangent numbers it is its own derivative, exact to round-off.
#include <cstring>
#include <iterator>
#include <limits>
#include <string_view>
#include <type_traits>

#include "core/abi/cardan_device.h"
#include "core/abi/family.hpp"
#include "core/spatial/tangent.hpp"
#include "core/spatial/vec3.hpp"

// Members are appended to the structs of the contract: what a description leaves out at its end is 0.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace cardan {

namespace param {

constexpr cardan_param_desc not_negative(const cardan_param_desc& desc) {
  return in_range(desc, 0.0, std::numeric_limits<double>::infinity());
}
constexpr cardan_param_desc positive(const cardan_param_desc& desc) {
  return in_range(desc, 0.0, std::numeric_limits<double>::infinity(), CARDAN_ABOVE);
}
/// The fallback of a vector.
constexpr cardan_param_desc along(cardan_param_desc desc, double x, double y, double z) {
  desc.fallback[0] = x, desc.fallback[1] = y, desc.fallback[2] = z;
  return desc;
}

}  // namespace param

/// cardan_mount_motion on a scalar.
template <class T>
struct MountMotion {
  Mat3<T> R_WN;
  Vec3<T> position, omega, velocity;
  T q, v;
  Vec3<T> alpha, specific_force;
  T vdot;
  T field[8];
};
/// cardan_mount_load on a scalar.
template <class T>
struct MountLoad {
  Vec3<T> moment, force;
  T tau;
};

/// cardan_mass on a scalar.
template <class T>
struct CarriedMass {
  T mass;
  Vec3<T> centre;
  Sym3<T> inertia;
};

/// What a law reads.
template <class T>
struct DeviceIn {
  double t;                  // [s]
  const T* in;               // inputs
  const T* z;                // states
  const double* d;           // marks
  const MountMotion<T>* at;  // mounts
};
/// What it fills; zero before.
template <class T>
struct DeviceOut {
  T* zdot;
  T* out;
  MountLoad<T>* load;
  T delivered{}, lost{};  // [W]
};

/// `mounts`, `ports`, `states`, `marks`, `schema`, `role` may be left out, as may `nominal`, `energy`, `roots`, `event`, `tick`, `mass` (a
/// template as `evaluate` is), `follow` (one as well), `momentum`, `holds`, `impulse`; and `can_carry`, false at states without a mass.
/// An `evaluate` or `tick` that may refuse returns an int, 0 where it does not, and `explain` tells what another one means.
template <class F>
concept DeviceFamily = requires(const typename F::Packed& p, const DeviceIn<double>& a, DeviceOut<double>& b, const DeviceIn<Tangent>& at,
                                DeviceOut<Tangent>& bt) {
  { F::type } -> std::convertible_to<std::string_view>;
  { F::summary } -> std::convertible_to<std::string_view>;
  { F::facts } -> std::convertible_to<unsigned>;
  requires std::is_trivially_copyable_v<typename F::Packed>;
  { F::evaluate(p, a, b) }
  noexcept;
  { F::evaluate(p, at, bt) }
  noexcept;
};

namespace detail {

template <class Array>
constexpr std::uint32_t count_of(const Array& all) {
  return sizeof(all) / sizeof(all[0]);
}
#define CARDAN_LIST_OF(F, name)                   \
  [] {                                            \
    if constexpr (requires { F::name; })          \
      return ::cardan::detail::count_of(F::name); \
    else                                          \
      return std::uint32_t{0};                    \
  }()

template <class F>
struct DeviceSizes {
  static constexpr std::uint32_t mounts = CARDAN_LIST_OF(F, mounts), ports = CARDAN_LIST_OF(F, ports), states = CARDAN_LIST_OF(F, states),
                                 marks = CARDAN_LIST_OF(F, marks), schema = CARDAN_LIST_OF(F, schema);
};

/// Arrays of a law on numbers with a derivative; at least one element, as C++ wants.
template <class F>
struct DeviceBuffers {
  using Sizes = DeviceSizes<F>;
  MountMotion<Tangent> at[Sizes::mounts + 1];
  MountLoad<Tangent> load[Sizes::mounts + 1]{};
  Tangent in[Sizes::ports + 1], z[Sizes::states + 1], zdot[Sizes::states + 1]{}, out[Sizes::ports + 1]{};
};

inline constexpr int kMotionNumbers = sizeof(cardan_mount_motion) / sizeof(double),
                     kLoadNumbers = sizeof(cardan_mount_load) / sizeof(double);
static_assert(sizeof(MountMotion<double>) == sizeof(cardan_mount_motion) && sizeof(MountLoad<double>) == sizeof(cardan_mount_load));
static_assert(sizeof(MountMotion<Tangent>) == 2 * sizeof(cardan_mount_motion));

template <class F>
constexpr std::uint32_t inputs_of() {
  std::uint32_t n = 0;
  if constexpr (requires { F::ports; })
    for (const cardan_port_desc& port : F::ports) n += port.kind == CARDAN_PORT_IN;
  return n;
}

/// The structs of the contract are those of a law on doubles, number by number.
inline DeviceIn<double> read(const cardan_device_args* a) {
  return {a->t, a->in, a->z, a->d, reinterpret_cast<const MountMotion<double>*>(a->mount)};
}

/// Of a law that may refuse its arguments, what it returns; else 0.
template <class Law>
int code_of(const Law& law) {
  if constexpr (std::is_void_v<decltype(law())>) {
    law();
    return 0;
  } else {
    return law();
  }
}

template <class F>
int evaluate(const cardan_device_args* a, cardan_device_out* o) {
  DeviceOut<double> out{o->zdot, o->out, reinterpret_cast<MountLoad<double>*>(o->load)};
  const int code = code_of([&] { return F::evaluate(*static_cast<const typename F::Packed*>(a->packed), read(a), out); });
  o->delivered = out.delivered, o->lost = out.lost;
  return code;
}

inline void seed(Tangent* to, const double* x, const double* dx, std::uint32_t n) {
  for (std::uint32_t i = 0; i < n; ++i) to[i] = {x[i], dx[i]};
}
/// Mounts and states with their rates.
template <class F>
void seed_motion(DeviceBuffers<F>& b, const cardan_device_args* a, const cardan_device_args* d) {
  for (std::uint32_t i = 0; i < DeviceSizes<F>::mounts; ++i) {
    double x[kMotionNumbers], dx[kMotionNumbers];
    Tangent both[kMotionNumbers];
    std::memcpy(x, &a->mount[i], sizeof x), std::memcpy(dx, &d->mount[i], sizeof dx);
    seed(both, x, dx, kMotionNumbers);
    std::memcpy(static_cast<void*>(&b.at[i]), both, sizeof both);
  }
  seed(b.z, a->z, d->z, DeviceSizes<F>::states);
}

template <class F>
int tangent(const cardan_device_args* a, const cardan_device_args* d, cardan_device_out* o) {
  DeviceBuffers<F> b;
  seed_motion(b, a, d);
  seed(b.in, a->in, d->in, inputs_of<F>());
  DeviceOut<Tangent> out{b.zdot, b.out, b.load};
  const int code = code_of([&] {
    return F::evaluate(*static_cast<const typename F::Packed*>(a->packed), DeviceIn<Tangent>{a->t, b.in, b.z, a->d, b.at}, out);
  });
  for (std::uint32_t i = 0; i < DeviceSizes<F>::mounts; ++i) {
    Tangent all[kLoadNumbers];
    double dx[kLoadNumbers];
    std::memcpy(static_cast<void*>(all), &b.load[i], sizeof all);
    for (int j = 0; j < kLoadNumbers; ++j) dx[j] = all[j].d;
    std::memcpy(&o->load[i], dx, sizeof dx);
  }
  for (std::uint32_t i = 0; i < DeviceSizes<F>::states; ++i) o->zdot[i] = b.zdot[i].d;
  for (std::uint32_t i = 0; i < DeviceSizes<F>::ports - inputs_of<F>(); ++i) o->out[i] = b.out[i].d;
  o->delivered = out.delivered.d, o->lost = out.lost.d;
  return code;
}

template <class F>
int follow(const cardan_device_args* a, double* zdot) {
  F::follow(*static_cast<const typename F::Packed*>(a->packed), read(a), zdot);
  return 0;
}
template <class F>
int follow_tangent(const cardan_device_args* a, const cardan_device_args* d, double* zdot) {
  DeviceBuffers<F> b;
  seed_motion(b, a, d);
  F::follow(*static_cast<const typename F::Packed*>(a->packed), DeviceIn<Tangent>{a->t, nullptr, b.z, nullptr, b.at}, b.zdot);
  for (std::uint32_t i = 0; i < DeviceSizes<F>::states; ++i) zdot[i] = b.zdot[i].d;
  return 0;
}

template <class F>
int mass(const cardan_device_args* a, cardan_mass* out) {
  if constexpr (requires(const typename F::Packed& p) { F::can_carry(p, a->z); })
    if (!F::can_carry(*static_cast<const typename F::Packed*>(a->packed), a->z)) return 1;
  const CarriedMass<double> m =
      F::mass(*static_cast<const typename F::Packed*>(a->packed), DeviceIn<double>{a->t, nullptr, a->z, a->d, nullptr});
  const Sym3<double>& J = m.inertia;
  *out = {m.mass, {m.centre.x, m.centre.y, m.centre.z}, {J.xx, J.yy, J.zz, J.xy, J.xz, J.yz}};
  return 0;
}

template <class F>
int mass_tangent(const cardan_device_args* a, const double* dz, cardan_mass* out) {
  Tangent z[DeviceSizes<F>::states + 1];
  for (std::uint32_t i = 0; i < DeviceSizes<F>::states; ++i) z[i] = {a->z[i], dz[i]};
  const CarriedMass<Tangent> m =
      F::mass(*static_cast<const typename F::Packed*>(a->packed), DeviceIn<Tangent>{a->t, nullptr, z, a->d, nullptr});
  const Sym3<Tangent>& J = m.inertia;
  *out = {m.mass.d, {m.centre.x.d, m.centre.y.d, m.centre.z.d}, {J.xx.d, J.yy.d, J.zz.d, J.xy.d, J.xz.d, J.yz.d}};
  return 0;
}

}  // namespace detail

/// The C table of F; lives for the whole program.
template <DeviceFamily F>
const cardan_device_family& device_table() {
  using P = typename F::Packed;
  using Sizes = detail::DeviceSizes<F>;
  static const cardan_device_family table = [] {
    cardan_device_family t{};
    t.struct_size = sizeof t;
    t.type = F::type;
    t.summary = F::summary;
    t.facts = F::facts;
    if constexpr (requires { F::role; }) t.role = F::role;
    t.params_size = sizeof(P);
    t.n_params = Sizes::schema, t.n_mounts = Sizes::mounts, t.n_ports = Sizes::ports, t.n_states = Sizes::states, t.n_marks = Sizes::marks;
    t.param_size = sizeof(cardan_param_desc), t.mount_size = sizeof(cardan_mount_desc), t.port_size = sizeof(cardan_port_desc);
    t.state_size = t.mark_size = sizeof(cardan_state_desc);
    if constexpr (Sizes::schema > 0) t.params = std::data(F::schema);
    if constexpr (Sizes::mounts > 0) t.mounts = F::mounts;
    if constexpr (Sizes::ports > 0) t.ports = F::ports;
    if constexpr (Sizes::states > 0) t.states = F::states;
    if constexpr (Sizes::marks > 0) t.marks = F::marks;
    t.pack = &detail::pack<F>;
    if constexpr (requires(const P& p, double* sizes) { F::nominal(p, sizes); })
      t.nominal = [](const void* packed, double* sizes) { F::nominal(*static_cast<const P*>(packed), sizes); };
    t.evaluate = &detail::evaluate<F>;
    t.tangent = &detail::tangent<F>;
    if constexpr (requires(const P& p, const DeviceIn<double>& a) { F::energy(p, a); })
      t.energy = [](const cardan_device_args* a) { return F::energy(*static_cast<const P*>(a->packed), detail::read(a)); };
    if constexpr (requires { F::n_roots; }) {
      t.n_roots = F::n_roots;
      t.roots = [](const cardan_device_args* a, double* g) { F::roots(*static_cast<const P*>(a->packed), detail::read(a), g); };
    }
    if constexpr (requires(const P& p, const DeviceIn<double>& a, double* x) { F::event(p, a, 0u, 0, x, x); })
      t.event = [](const cardan_device_args* a, std::uint32_t root, int direction, double* z, double* d) {
        F::event(*static_cast<const P*>(a->packed), detail::read(a), root, direction, z, d);
      };
    if constexpr (requires { F::n_noise; }) t.n_noise = F::n_noise;
    if constexpr (requires(const P& p, const DeviceIn<double>& a, double* x) { F::tick(p, a, 0.0, x, x, x); })
      t.tick = [](const cardan_device_args* a, double period, const double* noise, double* z, double* d) {
        if constexpr (std::is_void_v<decltype(F::tick(*static_cast<const P*>(a->packed), detail::read(a), period, noise, z, d))>) {
          F::tick(*static_cast<const P*>(a->packed), detail::read(a), period, noise, z, d);
          return 0;
        } else {
          return F::tick(*static_cast<const P*>(a->packed), detail::read(a), period, noise, z, d);
        }
      };
    if constexpr (requires(const P& p, const DeviceIn<double>& a) { F::mass(p, a); })
      t.mass = &detail::mass<F>, t.mass_tangent = &detail::mass_tangent<F>;
    if constexpr (requires(const P& p, const DeviceIn<double>& a, double* zdot) { F::follow(p, a, zdot); })
      t.follow = &detail::follow<F>, t.follow_tangent = &detail::follow_tangent<F>;
    if constexpr (requires(const P& p, const DeviceIn<double>& a) { F::holds(p, a); })
      t.holds = [](const cardan_device_args* a) { return F::holds(*static_cast<const P*>(a->packed), detail::read(a)); };
    if constexpr (requires(const P& p, const DeviceIn<double>& a, MountLoad<double>* load) { F::impulse(p, a, 0u, 0, load); })
      t.impulse = [](const cardan_device_args* a, std::uint32_t cause, int direction, cardan_mount_load* load) {
        F::impulse(*static_cast<const P*>(a->packed), detail::read(a), cause, direction, reinterpret_cast<MountLoad<double>*>(load));
        return 0;
      };
    if constexpr (requires(const P& p) { F::explain(p, 1); })
      t.explain = [](const void* packed, int code) -> const char* { return F::explain(*static_cast<const P*>(packed), code); };
    if constexpr (requires(const P& p, const DeviceIn<double>& a, Vec3<double>* h) { F::momentum(p, a, h); })
      t.momentum = [](const cardan_device_args* a, double(*h)[3]) {
        F::momentum(*static_cast<const P*>(a->packed), detail::read(a), reinterpret_cast<Vec3<double>*>(h));
      };
    return t;
  }();
  return table;
}

}  // namespace cardan
