#pragma once
// From a C++ hinge (a struct of static functions, checked by a concept) to the C table of cardan_abi.h. A hinge is one
// file: its parameters, its kinematics, its derivative. Axis hinges give only their axis.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstring>
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
  double number(const char* name) const { return *values_->numbers(values_, name, nullptr); }
  Eigen::Vector3d vector(const char* name, int i = 0) const {
    return Eigen::Map<const Eigen::Vector3d>(values_->numbers(values_, name, nullptr) + 3 * i);
  }
  /// How many vectors of 3 were given; 0 when the parameter is absent.
  int count(const char* name) const {
    std::uint32_t n = 0;
    return values_->numbers(values_, name, &n) ? static_cast<int>(n / 3) : 0;
  }
  const char* text(const char* name) const { return values_->text(values_, name); }  ///< null when absent
  bool fail(const char* name, const char* expected) const {
    values_->fail(values_, name, expected);
    return false;
  }

 private:
  const cardan_param_values* values_;
};

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
    { F::map_dot(p, q, v) }
    noexcept->std::convertible_to<Eigen::Matrix<double, 6, F::nv>>;
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
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out[j].R_OP) = o.R_OP;
    Eigen::Map<Eigen::Vector3d>(out[j].p_OP) = o.p_OP;
    if constexpr (F::nv > 0) Eigen::Map<Eigen::Matrix<double, 6, F::nv>>(out[j].Ht) = o.Ht;
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(out[j].Hdot_v) = o.Hdot_v;
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
    }
    if constexpr (F::nq > 0) {
      t.q_names = F::q_names;
      t.q_units = F::q_units;
    }
    if constexpr (F::nv > 0) {
      t.v_names = F::v_names;
      t.v_units = F::v_units;
    }
    t.pack = [](const cardan_param_values* values, void* packed) {
      P p{};
      if (!F::pack(Params(values), p)) return 1;
      std::memcpy(packed, &p, sizeof p);
      return 0;
    };
    if constexpr (kIsAxisHinge<F>)
      t.axis = [](const void* packed, double u[3], double* pitch) {
        const AxisParams& p = *static_cast<const P*>(packed);
        std::memcpy(u, p.u, sizeof p.u);
        *pitch = p.pitch;
        return 0;
      };
    t.kinematics = &detail::kinematics<F>;
    t.qdot = [](const void* packed, const double* q, const double* v, double* qdot) {
      if constexpr (F::nq == F::nv)
        std::copy_n(v, F::nv, qdot);  // v may be null where nv = 0
      else
        F::qdot(*static_cast<const P*>(packed), q, v, qdot);
    };
    t.map_dot = [](const void* packed, const double* q, const double* u, double* out) {
      if constexpr (kIsAxisHinge<F> || F::nv == 0)
        std::fill_n(out, 6 * F::nv, 0.0);
      else {
        const Eigen::Matrix<double, 6, F::nv> d = F::map_dot(*static_cast<const P*>(packed), q, u);
        std::memcpy(out, d.data(), sizeof(double) * 6 * F::nv);
      }
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
