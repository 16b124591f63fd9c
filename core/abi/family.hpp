#pragma once
// From a C++ hinge (a struct of static functions, checked by a concept) to the C table of cardan_abi.h. A hinge is one
// file: its parameters and its kinematics. Axis hinges give only their axis.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "core/abi/cardan_abi.h"

namespace cardan {

/// What a hinge gives at (q, v): the frame P in O and the hinge map. Shapes and axes: cardan_hinge_out.
template <int NV>
struct HingeOut {
  Eigen::Matrix3d R_OP = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_OP = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 6, NV> Ht = Eigen::Matrix<double, 6, NV>::Zero();
  Eigen::Matrix<double, 6, 1> Hdot_v = Eigen::Matrix<double, 6, 1>::Zero();
};

/// Typed access to the checked parameters during pack().
class Params {
 public:
  explicit Params(const cardan_param_values* values) : values_(values) {}
  double number(const char* name) const { return *numbers(name); }
  Eigen::Vector3d vector(const char* name, int i = 0) const { return Eigen::Map<const Eigen::Vector3d>(numbers(name) + 3 * i); }
  /// How many vectors of 3 were given; 0 when the parameter is absent.
  int count(const char* name) const {
    std::uint32_t n = 0;
    return values_->numbers(values_, name, &n) ? static_cast<int>(n / 3) : 0;
  }
  const char* text(const char* name) const { return values_->text(values_, name); }  ///< null when absent
  bool truth(const char* name) const { return number(name) != 0.0; }
  int integer(const char* name) const { return static_cast<int>(number(name)); }
  int choice(const char* name) const { return integer(name); }  ///< its index
  /// Rows of numbers as columns of the result: table(name, 3).col(0) is the first row. No columns when the parameter is absent.
  Eigen::Map<const Eigen::MatrixXd> table(const char* name, int columns) const {
    std::uint32_t n = 0;
    const double* data = values_->numbers(values_, name, &n);
    return {data, columns, static_cast<Eigen::Index>(n) / columns};
  }
  /// The content of a file; empty when absent.
  std::string_view bytes(const char* name) const {
    std::uint64_t size = 0;
    const void* data = values_->bytes(values_, name, &size);
    return {static_cast<const char*>(data), data ? size : 0};
  }
  /// Refuses; `got` and `hint` as in cardan_param_values.fail.
  bool fail(const char* name, const char* expected, const char* got = nullptr, const char* hint = nullptr) const {
    values_->fail(values_, name, expected, got, hint);
    return false;
  }

 private:
  const double* numbers(const char* name) const {
    const double* all = values_->numbers(values_, name, nullptr);
    if (!all) throw std::invalid_argument("pack asks for the parameter \"" + std::string(name) + "\", which has no numbers");
    return all;
  }
  const cardan_param_values* values_;
};

/// Descriptions of parameters, for a `schema`.
namespace param {

constexpr cardan_param_desc required(const char* name, cardan_param_kind kind, const char* unit, const char* meaning,
                                     std::uint32_t count = 0) {
  return {name, static_cast<std::uint32_t>(kind), CARDAN_REQUIRED, unit, meaning, {}, 0.0, 0.0, count, nullptr, nullptr};
}
constexpr cardan_param_desc optional(const char* name, cardan_param_kind kind, const char* unit, const char* meaning, double fallback = 0.0,
                                     std::uint32_t count = 0) {
  return {name, static_cast<std::uint32_t>(kind), 0u, unit, meaning, {fallback}, 0.0, 0.0, count, nullptr, nullptr};
}
/// The same with a range; `ends`: CARDAN_ABOVE, CARDAN_BELOW, or both.
constexpr cardan_param_desc in_range(cardan_param_desc desc, double lower, double upper, std::uint32_t ends = 0u) {
  desc.lower = lower, desc.upper = upper, desc.flags |= ends;
  return desc;
}
/// Of a vector: one number may stand for all three.
constexpr cardan_param_desc of_each(cardan_param_desc desc) {
  desc.flags |= CARDAN_EACH;
  for (double& x : desc.fallback) x = desc.fallback[0];
  return desc;
}
/// The choice among texts, the columns of a table.
template <std::size_t n>
constexpr cardan_param_desc named(cardan_param_desc desc, const char* const (&names)[n]) {
  desc.names = names, desc.count = n;
  return desc;
}

}  // namespace param

template <class F>
inline constexpr bool kIsAxisHinge = F::shape == CARDAN_SHAPE_ROTATION || F::shape == CARDAN_SHAPE_SLIDE || F::shape == CARDAN_SHAPE_SCREW;

/// The laws that a model of this concept must obey are executable: core/abi/laws.hpp.
template <class F>
concept HingeFamily = requires(const typename F::Packed& p, const double* q, const double* v, HingeOut<F::nv>& out, double* qdot,
                               const Params& params, typename F::Packed& packed) {
  { F::type } -> std::convertible_to<std::string_view>;
  { F::summary } -> std::convertible_to<std::string_view>;
  requires F::nv >= 0 && F::nv <= 6 && F::nq >= F::nv;
  requires std::is_trivially_copyable_v<typename F::Packed>;
  { F::pack(params, packed) } -> std::convertible_to<bool>;
  requires kIsAxisHinge<F> || requires {
    { F::kinematics(p, q, v, out) }
    noexcept;
  };
  requires F::nq == F::nv || requires {
    { F::qdot(p, q, v, qdot) }
    noexcept;
    { F::normalise(p, qdot) }
    noexcept;
    { F::retract(p, q, v, qdot) }
    noexcept;
    { F::difference(p, q, q, qdot) }
    noexcept;
    { F::zero(p, qdot) }
    noexcept;
  };
};

/// Axis hinges: u and pitch stand at the head of the packed parameters.
struct AxisParams {
  double u[3];
  double pitch;
};

namespace detail {

/// R = exp(u~ q), l = u q or pitch q u; the map is constant.
template <class F>
void axis_kinematics(const AxisParams& p, double q, HingeOut<1>& out) noexcept {
  const Eigen::Vector3d u(p.u[0], p.u[1], p.u[2]);
  if constexpr (F::shape != CARDAN_SHAPE_SLIDE) {
    Eigen::Matrix3d t;
    t << 0, -u.z(), u.y(), u.z(), 0, -u.x(), -u.y(), u.x(), 0;
    out.R_OP = Eigen::Matrix3d::Identity() + std::sin(q) * t + (1.0 - std::cos(q)) * t * t;
    out.Ht.template head<3>() = u;
  }
  if constexpr (F::shape == CARDAN_SHAPE_SLIDE) {
    out.p_OP = q * u;
    out.Ht.template tail<3>() = u;
  }
  if constexpr (F::shape == CARDAN_SHAPE_SCREW) {
    out.p_OP = p.pitch * q * u;
    out.Ht.template tail<3>() = p.pitch * u;
  }
}

/// Packs an instance of any C++ family; without F::pack all of it is zero.
template <class F>
int pack(const cardan_param_values* values, void* packed) {
  typename F::Packed p{};
  if constexpr (requires { F::pack(Params(values), p); })
    if (!F::pack(Params(values), p)) return 1;
  std::memcpy(packed, &p, sizeof p);
  return 0;
}

template <int NV>
[[gnu::always_inline]] inline void store(const HingeOut<NV>& o, cardan_hinge_out& out) {
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.R_OP) = o.R_OP;
  Eigen::Map<Eigen::Vector3d>(out.p_OP) = o.p_OP;
  if constexpr (NV > 0) Eigen::Map<Eigen::Matrix<double, 6, NV>>(out.Ht) = o.Ht;
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(out.Hdot_v) = o.Hdot_v;
}

template <HingeFamily F>
void kinematics(const void* packed, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* q, const double* v,
                cardan_hinge_out* out) {
  const auto* p = static_cast<const typename F::Packed*>(packed);
  for (std::uint32_t j = 0; j < n; ++j) {
    HingeOut<F::nv> o;
    if constexpr (kIsAxisHinge<F>)
      axis_kinematics<F>(p[j], q[iq[j]], o);
    else
      F::kinematics(p[j], q + iq[j], v + iv[j], o);
    store(o, out[j]);
  }
}

}  // namespace detail

/// The C table of F; lives for the whole program.
template <HingeFamily F>
const cardan_hinge_family& hinge_table() {
  using P = typename F::Packed;
  static const cardan_hinge_family table = [] {
    cardan_hinge_family t{};
    t.struct_size = sizeof(cardan_hinge_family);
    t.type = F::type;
    t.summary = F::summary;
    t.nq = F::nq;
    t.nv = F::nv;
    t.shape = F::shape;
    t.params_size = sizeof(P);
    if constexpr (requires { F::schema; }) {
      t.params = F::schema;
      t.n_params = sizeof(F::schema) / sizeof(F::schema[0]);
      t.param_size = sizeof(cardan_param_desc);
    }
    if constexpr (F::nq > 0) {
      t.q_names = F::q_names;
      t.q_units = F::q_units;
    }
    if constexpr (F::nv > 0) {
      t.v_names = F::v_names;
      t.v_units = F::v_units;
    }
    t.pack = &detail::pack<F>;
    if constexpr (kIsAxisHinge<F>)
      t.axis = [](const void* packed, double u[3], double* pitch) {
        const AxisParams& p = *static_cast<const P*>(packed);
        std::memcpy(u, p.u, sizeof p.u);
        *pitch = p.pitch;
      };
    t.kinematics = &detail::kinematics<F>;
    t.qdot = [](const void* packed, const double* q, const double* v, double* qdot) {
      if constexpr (requires { F::qdot(*static_cast<const P*>(packed), q, v, qdot); })
        F::qdot(*static_cast<const P*>(packed), q, v, qdot);
      else
        std::copy_n(v, F::nv, qdot);  // v may be null where nv = 0
    };
    if constexpr (F::nq != F::nv) {
      t.zero = [](const void* p, double* q) { F::zero(*static_cast<const P*>(p), q); };
      t.normalise = [](const void* p, double* q) { F::normalise(*static_cast<const P*>(p), q); };
      t.retract = [](const void* p, const double* q, const double* d, double* out) { F::retract(*static_cast<const P*>(p), q, d, out); };
      t.difference = [](const void* p, const double* a, const double* b, double* d) { F::difference(*static_cast<const P*>(p), a, b, d); };
    }
    return t;
  }();
  return table;
}

/// Packs the unit vector `axis` (and `pitch` where the schema has it).
inline bool pack_axis(const Params& params, AxisParams& p, bool with_pitch) {
  const Eigen::Vector3d u = params.vector("axis");
  std::memcpy(p.u, u.data(), sizeof p.u);
  p.pitch = with_pitch ? params.number("pitch") : 0.0;
  return true;
}

}  // namespace cardan
