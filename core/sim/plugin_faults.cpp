#include "core/sim/plugin_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/abi/field_family.hpp"
#include "core/abi/law_tools.hpp"
#include "core/base/finite.hpp"
#include "core/dynamics/devices.hpp"

namespace cardan {
namespace {

/// What is wrong with a function that fills `sizes` numbers, by call(pointers): asked twice.
template <class Call>
std::string wrong_with(const char* function, const std::vector<std::size_t>& sizes, const Call& call) {
  std::vector<Handed> answers[2];
  for (std::vector<Handed>& answer : answers) {
    std::vector<double*> to;
    for (const std::size_t n : sizes) answer.emplace_back(n);
    for (std::size_t i = 0; i < sizes.size(); ++i) std::fill_n(answer[i].data(), sizes[i], 0.0), to.push_back(answer[i].data());
    try {
      call(to);
    } catch (const std::exception& e) {
      return fmt::format("{} throws: {}", function, e.what());
    } catch (...) {
      return fmt::format("{} throws an exception that is no std::exception", function);
    }
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      if (!answer[i].intact()) return fmt::format("{} writes beyond what it is handed", function);
      if (!all_finite(answer[i].data(), static_cast<int>(sizes[i]))) return fmt::format("{} gives a value that is not finite", function);
    }
  }
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (std::memcmp(answers[0][i].data(), answers[1][i].data(), sizes[i] * sizeof(double)) != 0)
      return fmt::format("{} gives other numbers when it is asked the same again: it keeps something between calls", function);
  return {};
}

std::string wrong_with_hinge(const UserBody& u, const double* q, const double* v) {
  const cardan_hinge_family& f = *u.hinge;
  const std::string told = wrong_with("kinematics", {sizeof(cardan_hinge_out) / sizeof(double)}, [&](const std::vector<double*>& to) {
    const std::uint32_t zero = 0;
    f.kinematics(u.hinge_packed.data(), 1, &zero, &zero, q, v, reinterpret_cast<cardan_hinge_out*>(to[0]));
  });
  if (!told.empty()) return told;
  return wrong_with("qdot", {f.nq}, [&](const std::vector<double*>& to) { f.qdot(u.hinge_packed.data(), q, v, to[0]); });
}

std::string wrong_with_body(const FlexibleBody& f, int m, const double* eta, const double* etadot) {
  const double omega[3] = {};
  const auto n = static_cast<std::size_t>(m);
  std::string told = wrong_with("mass", {10, 6 * n, n * n},
                                [&](const std::vector<double*>& to) { f.family->mass(f.packed.data(), eta, to[0], to[1], to[2]); });
  if (!told.empty()) return told;
  told = wrong_with("bias", {6 + n}, [&](const std::vector<double*>& to) { f.family->bias(f.packed.data(), eta, etadot, omega, to[0]); });
  for (std::uint32_t i = 0; told.empty() && f.curved && i < f.data->nodes.size(); ++i)
    told = wrong_with("node", {6, 6 * n, 6},
                      [&](const std::vector<double*>& to) { f.family->node(f.packed.data(), i, eta, etadot, to[0], to[1], to[2]); });
  return told;
}

bool asks_hinge(const UserBody& u) { return u.nv > 0 && is_of_plugin(u.hinge_origin); }
bool asks_body(const UserBody& u) { return u.n_modes > 0 && is_of_plugin(u.family_origin); }

}  // namespace

bool has_plugins(const Model& m) {
  return std::ranges::any_of(m.user, [](const UserBody& u) { return asks_hinge(u) || asks_body(u); }) ||
         std::ranges::any_of(m.devices.all, [](const Device& d) { return is_of_plugin(d.origin); }) ||
         std::ranges::any_of(m.fields, [](const Field& f) { return is_of_plugin(f.origin); });
}

std::string plugin_at_fault(const Model& model, const double* q, const double* v) {
  if (!all_finite(q, model.nq) || !all_finite(v, model.nv)) return {};
  for (const UserBody& u : model.user) {
    const auto told = [&](const std::string& what, const char* word, const std::string& type, const std::string& origin) {
      const std::size_t end = what.find(' ');  // of the name of the function
      return fmt::format("{} of {} \"{}\" ({}) of bodies.{}{}", what.substr(0, end), word, type, origin, u.name, what.substr(end));
    };
    if (asks_hinge(u))
      if (const std::string w = wrong_with_hinge(u, q + u.q, v + u.v); !w.empty()) return told(w, "hinge", u.hinge_type, u.hinge_origin);
    if (asks_body(u)) {
      const FlexibleBody& flexible = model.flexible[static_cast<std::size_t>(model.bodies[static_cast<std::size_t>(u.sweep)].flexible)];
      if (const std::string w = wrong_with_body(flexible, u.n_modes, q + u.eta, v + u.etadot); !w.empty())
        return told(w, "body", u.type, u.family_origin);
    }
  }
  return {};
}

std::string plugin_at_fault(const Field& field, const FieldMoment& when, int n, const double* points) {
  if (!is_of_plugin(field.origin)) return {};
  const cardan_field_family& f = *field.source->family;
  const bool placed = !is_of_time(f.quantity);
  const auto count = static_cast<std::uint32_t>(placed ? n : 1);
  const cardan_field_args args{sizeof args, when.t, field.source->packed.data(), when.prepared};
  const std::string told = wrong_with("evaluate", {count * field_size(f.quantity)}, [&](const std::vector<double*>& to) {
    f.evaluate(&args, count, placed ? points : nullptr, to[0], nullptr);
  });
  return told.empty() ? "" : fmt::format("field {}: {}", told_name(field), told);
}

std::string plugin_at_fault(const Model& model, DeviceForces& devices) {
  std::string of_field;
  devices.visit_fields([&](int field, const FieldMoment& when, int n, const double* points) {
    if (of_field.empty()) of_field = plugin_at_fault(model.fields[static_cast<std::size_t>(field)], when, n, points);
  });
  if (!of_field.empty()) return of_field;
  for (std::size_t i = 0; i < model.devices.all.size(); ++i) {
    const Device& d = model.devices.all[i];
    if (!is_of_plugin(d.origin)) continue;
    if (const std::string told = devices.ask_again(static_cast<int>(i)); !told.empty()) return fmt::format("{}: {}", told_device(d), told);
  }
  return {};
}

std::string told_device(const Device& d) {
  return is_of_plugin(d.origin) ? fmt::format("device {} ({}, {})", d.name, d.family->type, d.origin)
                                : fmt::format("device {} ({})", d.name, d.family->type);
}

}  // namespace cardan
