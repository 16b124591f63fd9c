#pragma once
// modal_flexible that tells its constant shapes by node(): what the host does for any other family, done by the family.
#include <algorithm>
#include <cstdint>
#include <cstring>

#include "core/abi/cardan_body.h"

namespace cardan {
const cardan_body_family& modal_flexible_family();
}
namespace cardan::test {

/// Packed: this, the shapes of all nodes, then what modal_flexible packs.
struct ToldShapes {
  std::uint64_t n_modes, own;  // own: bytes before those of modal_flexible
  static const ToldShapes& of(const void* packed) { return *static_cast<const ToldShapes*>(packed); }
  const double* shapes() const { return reinterpret_cast<const double*>(this + 1); }
  const void* rest() const { return reinterpret_cast<const char*>(this) + own; }
};

inline const cardan_body_family& told_modal() {
  static const cardan_body_family table = [] {
    cardan_body_family t = modal_flexible_family();
    t.type = "test/told_modal";
    t.packed_size = [](const cardan_param_values* values, const cardan_modal_view* v) -> std::uint64_t {
      return sizeof(ToldShapes) + sizeof(double) * 6 * v->n_modes * v->n_nodes + modal_flexible_family().packed_size(values, v);
    };
    t.pack = [](const cardan_param_values* values, const cardan_modal_view* v, void* packed) {
      auto* head = static_cast<ToldShapes*>(packed);
      const std::size_t each = sizeof(double) * 6 * v->n_modes;
      *head = {v->n_modes, sizeof(ToldShapes) + each * v->n_nodes};
      char* to = reinterpret_cast<char*>(head + 1);
      for (std::uint32_t i = 0; i < v->n_nodes; ++i) std::memcpy(to + i * each, v->nodes[i].shapes, each);
      return modal_flexible_family().pack(values, v, to + v->n_nodes * each);
    };
    t.facts = [](const void* packed, cardan_body_facts* f) { modal_flexible_family().facts(ToldShapes::of(packed).rest(), f); };
    t.mass = [](const void* packed, const double* eta, double* rr, double* re, double* ee) {
      modal_flexible_family().mass(ToldShapes::of(packed).rest(), eta, rr, re, ee);
    };
    t.bias = [](const void* packed, const double* eta, const double* etadot, const double* omega, double* b) {
      modal_flexible_family().bias(ToldShapes::of(packed).rest(), eta, etadot, omega, b);
    };
    t.states = nullptr;
    t.node = [](const void* packed, std::uint32_t i, const double* eta, const double*, double* x, double* S, double* a) {
      const std::uint64_t m = ToldShapes::of(packed).n_modes;
      const double* shapes = ToldShapes::of(packed).shapes() + 6 * m * i;
      for (std::uint64_t r = 0; x && r < 6; ++r) {
        x[r] = 0.0;
        for (std::uint64_t j = 0; j < m; ++j) x[r] += shapes[6 * j + r] * eta[j];
      }
      if (S) std::memcpy(S, shapes, sizeof(double) * 6 * m);
      if (a) std::fill_n(a, 6, 0.0);
    };
    return t;
  }();
  return table;
}

}  // namespace cardan::test
