#pragma once
// Devices with as many rows of numbers as they are given: packed behind what has a fixed size.
#include <new>

#include "core/abi/device_family.hpp"

namespace cardan {

/// A Packed of theirs begins with this.
struct PackedRows {
  std::int64_t n;  // rows
};
/// F::row_size numbers each.
template <class F>
const double* rows_of(const typename F::Packed& p) noexcept {
  return reinterpret_cast<const double*>(&p + 1);
}

/// The C table of F, whose `packed_size` follows from its parameters and whose `pack` writes its rows to the array that it is given.
template <class F>
const cardan_device_family& device_table_with_rows() {
  using P = typename F::Packed;
  static_assert(sizeof(P) % sizeof(double) == 0);
  static const cardan_device_family table = [] {
    cardan_device_family t = device_table<F>();
    t.packed_size = [](const cardan_param_values* values) { return sizeof(P) + sizeof(double) * F::row_size * F::rows(Params(values)); };
    t.pack = [](const cardan_param_values* values, void* packed) {
      P* p = new (packed) P{};
      p->rows.n = static_cast<std::int64_t>(F::rows(Params(values)));
      return F::pack(Params(values), *p, reinterpret_cast<double*>(p + 1)) ? 0 : 1;
    };
    return t;
  }();
  return table;
}

/// Force and moment as a device gives them: on its only node, and as six outputs.
template <class T>
void give_wrench(const Vec3<T>& force, const Vec3<T>& moment, DeviceOut<T>& out) noexcept {
  out.load[0].force = force, out.load[0].moment = moment;
  out.out[0] = force.x, out.out[1] = force.y, out.out[2] = force.z, out.out[3] = moment.x, out.out[4] = moment.y, out.out[5] = moment.z;
}
/// `direct` as of cardan_port_desc.
template <std::uint64_t direct>
inline constexpr cardan_port_desc kWrenchPorts[] = {{"force_x", CARDAN_PORT_OUT, "N", 0.0, direct, "on the node", "at"},
                                                    {"force_y", CARDAN_PORT_OUT, "N", 0.0, direct, "on the node", "at"},
                                                    {"force_z", CARDAN_PORT_OUT, "N", 0.0, direct, "on the node", "at"},
                                                    {"moment_x", CARDAN_PORT_OUT, "N m", 0.0, direct, "on the node", "at"},
                                                    {"moment_y", CARDAN_PORT_OUT, "N m", 0.0, direct, "on the node", "at"},
                                                    {"moment_z", CARDAN_PORT_OUT, "N m", 0.0, direct, "on the node", "at"}};

}  // namespace cardan
