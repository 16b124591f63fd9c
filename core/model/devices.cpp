#include "core/model/devices.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "core/abi/device_laws.hpp"
#include "core/abi/port_vectors.hpp"
#include "core/base/units.hpp"
#include "core/model/device_order.hpp"
#include "core/model/device_units.hpp"
#include "core/model/fields.hpp"
#include "core/model/params.hpp"
#include "core/model/schema.hpp"

namespace cardan {
namespace {

constexpr double kFar = 1e4, kFast = 100.0;  // [m], [m/s]

bool is_far(const UserBody& u, std::span<const double> q, std::span<const double> v) {
  const auto beyond = [](std::span<const double> numbers, const std::vector<std::string>& units, std::string_view unit, double limit) {
    for (std::size_t i = 0; i < std::min(numbers.size(), units.size()); ++i)
      if (units[i] == unit && std::abs(numbers[i]) > limit) return true;
    return false;
  };
  return u.parent < 0 && (beyond(q, u.q_units, "m", kFar) || beyond(v, u.v_units, "m/s", kFast));
}

class DeviceCompiler {
 public:
  DeviceCompiler(const SystemSpec& spec, const Registry& registry, const Model& model, bool from_home, DiagnosticSink& sink)
      : spec_(spec), registry_(registry), model_(model), sink_(sink) {
    devices_.from_home = from_home || may_be_far(spec, model);
  }

  Devices run() {
    std::vector<int> by_name(spec_.devices.size());
    std::iota(by_name.begin(), by_name.end(), 0);
    std::ranges::stable_sort(by_name, {}, [this](int i) -> const std::string& { return spec_.devices[static_cast<std::size_t>(i)].name; });
    for (const int i : by_name) add(i);
    if (complete_) connect();
    return std::move(devices_);
  }

 private:
  using Family = cardan_device_family;

  void fault(Code code, const DeviceSpec& device, const std::string& key, std::string expected, std::string got, std::string hint = {}) {
    fault(code, spec_.locate(fmt::format("devices.{}{}{}", device.name, key.empty() ? "" : ".", key)), std::move(expected), std::move(got),
          std::move(hint));
  }
  void fault(Code code, Located at, std::string expected, std::string got, std::string hint) {
    complete_ = false;
    sink_.report(code, std::move(at), std::move(expected), std::move(got), std::move(hint));
  }

  const DeviceSpec& spec_of(const Device& d) const { return spec_.devices[static_cast<std::size_t>(d.spec)]; }

  void add(int index) {
    const DeviceSpec& spec = spec_.devices[static_cast<std::size_t>(index)];
    const Family* family = registry_.device(spec.type);
    if (!family) {
      std::vector<std::string> types = registry_.devices.types();
      std::ranges::sort(types);
      return fault(Code::unknown_device_type, spec, "type",
                   fmt::format("a device type: {}, or one from a loaded plugin", fmt::join(types, ", ")), in_quotes(spec.type),
                   did_you_mean(spec.type, types));
    }
    if (model_.find_body(spec.name) >= 0)
      return fault(Code::duplicate_name, spec, "", "a name that no body has", in_quotes(spec.name),
                   "names of bodies and devices stand side by side in scripts");
    if (devices_.find(spec.name) >= 0)
      return fault(Code::duplicate_name, spec, "", "a name of its own for each device", in_quotes(spec.name));
    const std::size_t faults = sink_.all().size();
    Device d;
    d.name = spec.name, d.spec = index;
    d.family = family, d.origin = registry_.devices.entry(spec.type)->origin;
    d.packed = pack_params(spec_, {"devices." + spec.name, fmt::format("device type {}", family->type), spec.params},
                           {{family->params, family->n_params}, family->params_size, family->pack, family->packed_size}, sink_);
    d.z = devices_.n_z, d.mark = devices_.n_marks, d.in = devices_.n_in, d.out = devices_.n_out, d.mount = devices_.n_mounts;
    d.root = devices_.n_roots;
    for (std::uint32_t i = 0; i < family->n_mounts; ++i)
      d.mounts.push_back(family->mounts[i].kind == CARDAN_MOUNT_FIELD ? field(spec, family->mounts[i], d) : mount(spec, family->mounts[i]));
    for (std::uint32_t i = 0; i < family->n_ports; ++i) {
      const cardan_port_desc& port = family->ports[i];
      if (port.kind == CARDAN_PORT_OUT) {
        ++d.n_out;
        continue;
      }
      ++d.n_in;
      devices_.in0.push_back(port.fallback);
      devices_.from.push_back(-1);
      if (const auto given = spec.inputs.find(port.name); given != spec.inputs.end()) {
        if (const double* x = std::get_if<double>(&given->second.value)) devices_.in0.back() = *x;
        check_options(spec, port, given->second, static_cast<int>(devices_.in0.size()) - 1);
      } else if ((port.flags & CARDAN_PORT_REQUIRED) != 0) {
        fault(Code::missing_key, spec, fmt::format("inputs.{}", port.name), fmt::format("a number or a connection: {}", port.meaning),
              "no such key");
      }
    }
    if (family->tick && !((spec.rate > 0.0 && std::isfinite(spec.rate)) || (spec.period > 0.0 && std::isfinite(spec.period))))
      fault(Code::out_of_range, spec, spec.period != 0.0 ? "period" : "rate", "a rate or a period > 0",
            spec.period != 0.0 ? fmt::format("{:g} s", spec.period) : fmt::format("{:g} Hz", spec.rate));
    initial(spec, {family->states, family->n_states}, devices_.z0);
    initial(spec, {family->marks, family->n_marks}, devices_.marks0);
    for (std::uint32_t i = 0; i < family->n_states; ++i) devices_.nominal.push_back(family->states[i].nominal);
    if (family->nominal && !d.packed.empty()) family->nominal(d.packed.data(), devices_.nominal.data() + d.z);
    devices_.n_z += static_cast<int>(family->n_states), devices_.n_marks += static_cast<int>(family->n_marks);
    devices_.n_in += d.n_in, devices_.n_out += d.n_out, devices_.n_mounts += static_cast<int>(family->n_mounts);
    devices_.n_roots += static_cast<int>(family->n_roots);
    devices_.rough = devices_.rough || (family->facts & CARDAN_FACT_ROUGH) != 0;
    complete_ = complete_ && sink_.all().size() == faults;
    if (devices_.from_home && reads_between_nodes(*family)) count_from_home(d.mounts);
    devices_.all.push_back(std::move(d));
  }

  /// From the world's origin, so that places are rounded: in orbit, or where what stands on the world begins there or flies there fast.
  static bool may_be_far(const SystemSpec& spec, const Model& model) {
    return model.field.pulls() || std::ranges::any_of(model.user, [&](const UserBody& u) {
             const HingeSpec& h = spec.bodies[static_cast<std::size_t>(&u - model.user.data())].hinge;
             return is_far(u, h.q, h.v) || (u.parent < 0 && h.onode_position.norm() > kFar);
           });
  }

  /// From the nearest common ancestor of its nodes, where there is one short of the world.
  void count_from_home(std::vector<DeviceMount>& mounts) const {
    const auto parent = [&](int k) { return model_.bodies[static_cast<std::size_t>(k)].parent; };
    int home = -1;
    for (const DeviceMount& m : mounts) {
      if (m.v >= 0 || m.still) continue;  // at a hinge
      int k = m.node >= 0 ? model_.user[static_cast<std::size_t>(model_.nodes[static_cast<std::size_t>(m.node)].body)].sweep : 0;
      if (home < 0) home = k;
      while (k != home) (k > home ? k : home) = parent(std::max(k, home));  // inboard bodies have smaller indices
    }
    for (DeviceMount& m : mounts) {
      if (m.node < 0 || home <= 0) continue;
      m.home = home;
      for (int k = model_.user[static_cast<std::size_t>(model_.nodes[static_cast<std::size_t>(m.node)].body)].sweep; k != home;
           k = parent(k))
        m.way.push_back(k);
      std::ranges::reverse(m.way);
    }
  }

  /// What may stand together at an input.
  void check_options(const DeviceSpec& spec, const cardan_port_desc& port, const DeviceSpec::Input& input, int index) {
    const std::string key = fmt::format("inputs.{}", port.name);
    const bool connected = std::holds_alternative<std::string>(input.value);
    if (connected && (input.safe || input.timeout != 0.0))
      return fault(Code::bad_connection, spec, key, "`safe` and `timeout` of an input that is commanded",
                   "a connection, which is never silent");
    if (!connected && (input.delay != 0 || input.latency != 0.0))
      return fault(Code::bad_connection, spec, key, "`delay` and `latency` of a connection (from, sum)", "a number that is commanded");
    if (input.safe.has_value() != (input.timeout != 0.0))
      return fault(Code::bad_connection, spec, key, "`safe` and `timeout` together", input.safe ? "no `timeout`" : "no `safe`");
    if (input.delay != 0 && input.latency != 0.0)
      return fault(Code::bad_connection, spec, key, "`delay` in ticks or `latency` in time", "both");
    if (input.latency < 0.0 || !std::isfinite(input.latency) || input.timeout < 0.0 || !std::isfinite(input.timeout))
      return fault(Code::out_of_range, spec, key, "a time > 0",
                   fmt::format("{:g} s", input.latency != 0.0 ? input.latency : input.timeout));
    if (input.delay > kMostTicks)
      return fault(Code::out_of_range, spec, key, fmt::format("at most {} ticks", kMostTicks), std::to_string(input.delay));
    if (input.safe) devices_.timeouts.push_back({index, *input.safe, input.timeout});
  }

  void initial(const DeviceSpec& spec, std::span<const cardan_state_desc> states, std::vector<double>& all) {
    for (const cardan_state_desc& state : states) {
      const auto given = spec.initial.find(state.name);
      const double* x = given == spec.initial.end() ? nullptr : std::get_if<double>(&given->second.value);
      all.push_back(x ? *x : state.initial);
      if (!std::isfinite(all.back()))
        fault(Code::bad_initial_state, spec, fmt::format("initial.{}", state.name), "a finite number", fmt::format("{}", all.back()));
    }
  }

  /// By its name, or the only one of its quantity, at the node of the mount before it.
  DeviceMount field(const DeviceSpec& spec, const cardan_mount_desc& desc, Device& d) {
    DeviceMount m{.load = -1};
    const std::uint32_t quantity = desc.use & ~static_cast<unsigned>(CARDAN_USE_OPTIONAL);
    const std::string key = fmt::format("devices.{}.{}", spec.name, desc.name);
    std::vector<int> fitting;
    for (std::size_t i = 0; i < model_.fields.size(); ++i)
      if (model_.fields[i].source->family->quantity == quantity) fitting.push_back(static_cast<int>(i));
    if (const auto given = spec.mounts.find(desc.name); given != spec.mounts.end()) {
      m.field = field_named(spec_, model_.fields, quantity, given->second.target, key, sink_);
    } else if (fitting.size() == 1) {
      m.field = fitting[0];
    } else if (!fitting.empty() || (desc.use & CARDAN_USE_OPTIONAL) == 0) {
      fault(Code::wrong_field, spec, desc.name, fmt::format("which field: {}: {}", desc.name, desc.meaning),
            fitting.empty() ? fmt::format("none of the quantity {} in `fields`", quantity_text(quantity)) : "several, and no such key");
    } else if (const auto half_angle = spec.params.find("exclusion"); quantity == CARDAN_LIGHT && half_angle != spec.params.end()) {
      const double* x = std::get_if<double>(&half_angle->second.value);
      if (x && *x != 0.0)
        fault(Code::wrong_field, spec, "exclusion", fmt::format("{}: {}", desc.name, desc.meaning), "no field of light in `fields`",
              "a field of the type sunlight; or no `exclusion`");
    }
    for (int i = static_cast<int>(d.mounts.size()) - 1; i >= 0 && m.at < 0; --i)
      if (DeviceMount& place = d.mounts[static_cast<std::size_t>(i)]; place.node >= 0) {
        m.at = i;
        if (m.field >= 0) place.use |= CARDAN_USE_POSE;
      }
    return m;
  }

  DeviceMount mount(const DeviceSpec& spec, const cardan_mount_desc& desc) {
    DeviceMount m{.use = desc.use, .load = -1};
    const auto given = spec.mounts.find(desc.name);
    if (given == spec.mounts.end()) {
      fault(Code::missing_key, spec, "", fmt::format("{}: {}", desc.name, desc.meaning), "no such key");
      return m;
    }
    const std::string& target = given->second.target;
    if (desc.kind == CARDAN_MOUNT_HINGE) {
      hinge_component(spec, desc, target, m);
      return m;
    }
    if (desc.kind == CARDAN_MOUNT_MASS) {
      m.use |= CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD;  // what flows pushes there
      rigid_body(spec, desc, target);
    }
    m.node = model_.find_node(target);
    if (desc.kind == CARDAN_MOUNT_NODE && target == "world" && may_be_ground(spec, desc)) {
      m.ground = {from_eigen(given->second.R), from_eigen(given->second.position)};
      return m;
    }
    if (m.node < 0 && desc.kind == CARDAN_MOUNT_NODE) {
      std::vector<std::string> names;
      if (may_be_ground(spec, desc)) names.emplace_back("world");
      for (const UserNode& node : model_.nodes) names.push_back(node.name);
      fault(Code::unknown_node, spec, desc.name, "a node: " + one_of(names), in_quotes(target), did_you_mean(target, names));
    }
    if ((m.use & CARDAN_USE_LOAD) != 0) m.load = devices_.n_loads++;
    return m;
  }

  /// What pushes two bodies against each other may push one against the ground: a mount at the origin of the world, with its axes.
  bool may_be_ground(const DeviceSpec& spec, const cardan_mount_desc& desc) const {
    const Family& f = *registry_.device(spec.type);
    const bool reads_fields = std::any_of(f.mounts, f.mounts + f.n_mounts, [](const auto& m) { return m.kind == CARDAN_MOUNT_FIELD; });
    return (f.facts & CARDAN_FACT_INTERNAL) != 0 && !f.follow && !f.momentum && !reads_fields &&
           (desc.use & (CARDAN_USE_ACCELERATION | CARDAN_USE_OUTLET | CARDAN_USE_IMPULSE)) == 0;
  }

  /// Of a mass: the body that carries it.
  void rigid_body(const DeviceSpec& spec, const cardan_mount_desc& desc, const std::string& target) {
    std::vector<std::string> names;
    for (const UserBody& u : model_.user)
      if (u.n_modes == 0) names.push_back(u.name);
    const int user = model_.find_body(target);
    if (user < 0)
      return fault(Code::unknown_body, spec, desc.name, "a rigid body: " + one_of(names), in_quotes(target), did_you_mean(target, names));
    const UserBody& u = model_.user[static_cast<std::size_t>(user)];
    if (u.n_modes > 0)
      return fault(Code::unsupported, spec, desc.name, "a rigid body", in_quotes(target) + ", which has modes",
                   "let a rigid body that is fixed to a node of it carry the mass");
    devices_.masses.push_back(
        {static_cast<int>(devices_.all.size()), static_cast<int>(&desc - registry_.device(spec.type)->mounts), user, u.M, u.mass});
  }

  /// "boom" where the hinge has one component, else "boom.rate".
  void hinge_component(const DeviceSpec& spec, const cardan_mount_desc& desc, const std::string& target, DeviceMount& m) {
    const bool must_turn = (desc.use & CARDAN_USE_TURN) != 0, needs_coordinate = (desc.use & CARDAN_USE_COORDINATE) != 0;
    std::string wanted = "a component of a hinge";
    if (must_turn) wanted += " that turns";
    if (needs_coordinate) wanted += must_turn ? ", with a coordinate" : " with a coordinate";
    std::vector<std::string> legal;
    std::string unfit;  // why the component that is named is none
    for (const UserBody& u : model_.user)
      for (int i = 0; i < u.nv; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const std::string name = u.name + "." + u.v_names[at];
        const bool slides = must_turn && !is_turn(u.v_units[at]), lacks = needs_coordinate && u.nq != u.nv;
        const bool same = target == name || (u.nv == 1 && target == u.name) || (u.nq == u.nv && target == u.name + "." + u.q_names[at]);
        if (slides || lacks) {
          if (same) unfit = slides ? "which slides" : "which has no coordinate of its own";
          continue;
        }
        legal.push_back(name);
        if (!same) continue;
        m.v = u.v + i;
        m.q = u.nq == u.nv ? u.q + i : -1;
        if ((desc.use & CARDAN_USE_HOLD) != 0) {
          if (const auto other = std::ranges::find(devices_.holds, m.v, &DeviceHold::v); other != devices_.holds.end())
            fault(Code::unsupported, spec, desc.name, "a component that no other device holds",
                  fmt::format("{}, which {} holds", in_quotes(target), devices_.all[static_cast<std::size_t>(other->device)].name),
                  "one device with the sum of what both hold");
          devices_.holds.push_back({static_cast<int>(devices_.all.size()), m.v});
        }
        if (model_.has_prescribed() && model_.prescribed[static_cast<std::size_t>(m.v)] &&
            (desc.use & (CARDAN_USE_LOAD | CARDAN_USE_IMPULSE)) != 0)
          fault(Code::unsupported, spec, desc.name, "a hinge component that is free to move", in_quotes(target) + ", which is prescribed",
                "its motion is given: what pushes there has no effect; a device of a script that reads alone says so: {reads = \"hinge\"}");
        return;
      }
    if (!unfit.empty())
      return fault(Code::unsupported, spec, desc.name, legal.empty() ? wanted + ", of which there is none" : wanted + ": " + one_of(legal),
                   fmt::format("{}, {}", in_quotes(target), unfit));
    const std::string first = target.substr(0, target.find('.'));
    if (std::ranges::any_of(spec_.loops, [&](const LoopSpec& l) { return l.name == first; }))
      return fault(
          Code::unsupported, spec, desc.name, "a component of a hinge in the tree: " + one_of(legal),
          fmt::format("{}, which closes a loop", in_quotes(first)),
          "put that hinge among `bodies` and let another one of the loop close it; where each has a load, cut a link in two and close "
          "the loop by a weld of its halves");
    const BodySpec* body = spec_.find(first);
    const cardan_hinge_family* family = body ? registry_.hinge(body->hinge.type) : nullptr;
    if (family && body->hinge.locked)
      for (std::uint32_t i = 0; i < family->nv; ++i) {
        const std::string name = first + "." + family->v_names[i];
        const bool has_q = family->nq == family->nv;
        const bool same = target == name || (family->nv == 1 && target == first) || (has_q && target == first + "." + family->q_names[i]);
        if ((must_turn && !is_turn(family->v_units[i])) || (needs_coordinate && !has_q)) continue;
        legal.push_back(name);
        if (same) m.still = {has_q && i < body->hinge.q.size() ? body->hinge.q[i] : 0.0, is_turn(family->v_units[i])};
      }
    if (family && (body->hinge.locked || family->nv == 0 || flies(body->hinge)) && !m.still)
      m.still = spec.mounts.find(desc.name)->second.last;
    if (m.still) return;
    fault(Code::unknown_name, spec, desc.name,
          legal.empty() ? wanted + ", of which there is none that moves" : wanted + ": " + one_of(legal), in_quotes(target),
          did_you_mean(target, legal));
  }

  static const cardan_port_desc& port(const Device& d, std::uint32_t kind, int index) { return port_at(*d.family, kind, index); }
  std::pair<int, int> owner_of_output(int out) const { return cardan::owner_of_output(devices_, out); }

  void connect() {
    for (Device& d : devices_.all)
      for (int k = 0; k < d.n_in; ++k) {
        const auto given = spec_of(d).inputs.find(port(d, CARDAN_PORT_IN, k).name);
        if (given == spec_of(d).inputs.end()) continue;
        if (const auto* sources = std::get_if<std::string>(&given->second.value)) add_sources(d, k, *sources, given->second);
      }
    connect_validity();
    if (complete_) complete_ = order_devices(spec_, devices_, sink_);
    if (complete_) find_flows();
    for (Device& d : devices_.all) {
      d.acts = (d.family->n_states > 0 && !d.family->follow) || d.family->n_roots > 0;
      for (const DeviceMount& m : d.mounts) d.acts = d.acts || (m.use & CARDAN_USE_LOAD) != 0;
    }
    for (bool more = true; more;) {
      more = false;
      for (const Device& taker : devices_.all)
        for (int k = taker.in; taker.acts && k < taker.in + taker.n_in; ++k)
          devices_.each_source(k, [&](int out) {
            Device& giver = devices_.all[static_cast<std::size_t>(owner_of_output(out).first)];
            more = more || !giver.acts;
            giver.acts = true;
          });
    }
    for (const Device& d : devices_.all)
      for (const DeviceMount& m : d.mounts)
        if (d.acts && m.field >= 0 && m.at >= 0 && (d.mounts[static_cast<std::size_t>(m.at)].use & CARDAN_USE_ACCELERATION) == 0)
          find_edges(d, m);
    // What does not act is looked at between steps alone, as is what a mount reads at ticks.
    for (const Device& d : devices_.all)
      for (const DeviceMount& m : d.mounts) {
        const bool in_steps = d.acts && (m.use & (CARDAN_USE_POSE | CARDAN_USE_VELOCITY)) != 0 && (m.use & CARDAN_USE_ACCELERATION) == 0;
        if (m.node >= 0 && (in_steps || d.family->follow)) devices_.reads_nodes = true;
      }
  }

  /// The user body on the ground that carries a node.
  int root_of(int node) const {
    int body = model_.nodes[static_cast<std::size_t>(node)].body;
    while (model_.user[static_cast<std::size_t>(body)].parent >= 0) body = model_.user[static_cast<std::size_t>(body)].parent;
    return body;
  }
  void find_edges(const Device& d, const DeviceMount& m) {
    const FieldSource& f = *model_.fields[static_cast<std::size_t>(m.field)].source;
    const int node = d.mounts[static_cast<std::size_t>(m.at)].node;
    if (!f.family->edges || node < 0) return;
    if (!edges_known_.emplace(m.field, root_of(node)).second) return;
    const cardan_field_args args{sizeof args, 0.0, f.packed.data(), f.prepared.empty() ? nullptr : f.prepared.data()};
    const int n = static_cast<int>(f.family->edges(&args, nullptr, nullptr));
    if (n == 0) return;
    devices_.edges.push_back({m.field, d.mount + m.at, devices_.n_edges, n});
    devices_.n_edges += n;
  }

  /// "gyro.rate_x", or a sum: "left.flow + right.flow".
  void add_sources(const Device& d, int k, const std::string& sources, const DeviceSpec::Input& input) {
    std::vector<int> all;
    for (std::size_t at = 0; at <= sources.size();) {
      const std::size_t end = std::min(sources.find('+', at), sources.size());
      const std::size_t first = sources.find_first_not_of(' ', at), last = sources.find_last_not_of(' ', end - (end > 0 ? 1 : 0));
      const bool empty = first >= end || last == std::string::npos || last < first;
      all.push_back(output_named(d, port(d, CARDAN_PORT_IN, k), empty ? "" : sources.substr(first, last - first + 1)));
      at = end + 1;
    }
    if (std::ranges::find(all, -1) != all.end()) return;
    std::ranges::sort(all);
    hear_validity(d, k, all, input);
    join(d, k, all, input, all);
  }

  /// With what is connected goes what says that it holds, to the input that asks for that; all inputs that have the same have one answer.
  void hear_validity(const Device& d, int k, const std::vector<int>& outs, const DeviceSpec::Input& input) {
    const char* asks = port(d, CARDAN_PORT_IN, k).valid;
    if (!asks || spec_of(d).inputs.contains(asks)) return;
    const std::pair at(devices_.find(d.name), place_of_port(*d.family, CARDAN_PORT_IN, asks));
    for (const int out : outs) {
      const auto [giver, place] = owner_of_output(out);
      const Device& from = devices_.all[static_cast<std::size_t>(giver)];
      const char* says = port(from, CARDAN_PORT_OUT, place).valid;
      if (!says) continue;
      Heard& heard = heard_[at];
      heard.input = &input, heard.beside = outs;
      heard.outs.insert(from.out + place_of_port(*from.family, CARDAN_PORT_OUT, says));
    }
  }
  void connect_validity() {
    for (const auto& [at, heard] : heard_) {
      const Device& d = devices_.all[static_cast<std::size_t>(at.first)];
      if (heard.outs.size() == 1) {
        join(d, at.second, {*heard.outs.begin()}, *heard.input, heard.beside);
        continue;
      }
      std::vector<std::string> names;
      for (const int out : heard.outs) {
        const auto [giver, place] = owner_of_output(out);
        const Device& from = devices_.all[static_cast<std::size_t>(giver)];
        names.push_back(fmt::format("{}.{}", from.name, port(from, CARDAN_PORT_OUT, place).name));
      }
      const char* asks = port(d, CARDAN_PORT_IN, at.second).name;
      fault(Code::bad_connection, spec_of(d), fmt::format("inputs.{}", asks), "one output that says whether what is connected holds",
            one_of(names), fmt::format("give devices.{}.inputs.{} itself: one of them, or 1", d.name, asks));
    }
  }

  /// `beside`: the ticks of a delay are those of a device that gives one of these.
  void join(const Device& d, int k, std::vector<int> all, const DeviceSpec::Input& input, const std::vector<int>& beside) {
    if (input.delay > 0 || input.latency > 0.0) return add_delay(d, k, std::move(all), input, beside);  // the line commands it
    devices_.from[static_cast<std::size_t>(d.in + k)] = all.front();
    for (std::size_t i = 1; i < all.size(); ++i) devices_.added.push_back({d.in + k, all[i]});
  }

  /// From whose mass what leaves at an outlet is drawn. Who draws from a mass takes something of it as well (its supply), and the other way
  /// round: else it would go on when nothing is left, or burn nothing.
  void expect_supply(const Device& tank, int key, const Device& d) {
    for (int k = d.in; k < d.in + d.n_in; ++k) {
      bool of_tank = false;
      devices_.each_source(k, [&](int out) { of_tank = of_tank || (out >= tank.out && out < tank.out + tank.n_out); });
      if (of_tank) return;
    }
    fault(Code::bad_connection, spec_of(tank), fmt::format("inputs.{}", port(tank, CARDAN_PORT_IN, key).name),
          fmt::format("a device that takes an output of {} in turn", tank.name), d.name,
          fmt::format("devices.{}.inputs: {{supply: {}.supply}}, so that it ends when nothing is left", d.name, tank.name));
  }
  void expect_drawn(const Device& d) {
    if (std::ranges::none_of(d.mounts, [](const DeviceMount& m) { return (m.use & CARDAN_USE_OUTLET) != 0; })) return;
    for (int k = d.in; k < d.in + d.n_in; ++k)
      devices_.each_source(k, [&](int out) {
        const int giver = owner_of_output(out).first;
        const Device& tank = devices_.all[static_cast<std::size_t>(giver)];
        if (!tank.family->mass) return;
        for (const MassFlow& flow : devices_.flows)
          if (devices_.masses[static_cast<std::size_t>(flow.from)].device == giver &&
              devices_.all[static_cast<std::size_t>(flow.device)].name == d.name)
            return;
        fault(Code::bad_connection, spec_of(d), fmt::format("inputs.{}", port(d, CARDAN_PORT_IN, k - d.in).name),
              fmt::format("a device that draws from {} where it takes an output of it", tank.name), "one that does not",
              fmt::format("devices.{}.inputs: {{flow: {}.flow}}; a sum where there are several", tank.name, d.name));
      });
  }
  void find_flows() {
    for (std::size_t m = 0; m < devices_.masses.size(); ++m) {
      const Device& tank = devices_.all[static_cast<std::size_t>(devices_.masses[m].device)];
      for (int k = 0; k < tank.n_in; ++k) {
        if (std::string_view(port(tank, CARDAN_PORT_IN, k).unit) != "kg/s") continue;
        devices_.each_source(tank.in + k, [&](int out) {
          const int giver = owner_of_output(out).first;
          Device& d = devices_.all[static_cast<std::size_t>(giver)];
          for (std::size_t i = 0; i < d.mounts.size(); ++i)
            if ((d.mounts[i].use & CARDAN_USE_OUTLET) != 0) {
              expect_supply(tank, k, d);
              if (const auto other = std::ranges::find(devices_.flows, out, &MassFlow::output); other != devices_.flows.end())
                fault(
                    Code::bad_connection, spec_of(tank), fmt::format("inputs.{}", port(tank, CARDAN_PORT_IN, k).name),
                    "flows of which each is drawn once",
                    fmt::format("that of {}, which {} gives too", d.name,
                                devices_.all[static_cast<std::size_t>(devices_.masses[static_cast<std::size_t>(other->from)].device)].name),
                    "an outlet for each of the tanks");
              d.mounts[i].use |= CARDAN_USE_POSE | CARDAN_USE_VELOCITY;
              devices_.flows.push_back({static_cast<int>(m), out, giver, static_cast<int>(i)});
            }
        });
      }
    }
    for (const Device& d : devices_.all) expect_drawn(d);
  }

  void add_delay(const Device& d, int k, std::vector<int> outs, const DeviceSpec::Input& input, const std::vector<int>& beside) {
    const cardan_port_desc& in = port(d, CARDAN_PORT_IN, k);
    int clock = d.family->tick ? devices_.find(d.name) : -1;
    for (std::size_t i = 0; clock < 0 && i < beside.size(); ++i)
      if (const int giver = owner_of_output(beside[i]).first; devices_.all[static_cast<std::size_t>(giver)].family->tick) clock = giver;
    if (clock < 0)
      return fault(Code::bad_connection, spec_of(d), fmt::format("inputs.{}", in.name),
                   "a device that samples at one end of what is delayed by ticks", "none: both are continuous",
                   "a lag is a device with a state");
    devices_.delays.push_back({d.in + k, std::move(outs), clock, input.delay, input.latency, in.fallback});
  }

  /// The node at which a device has the mount of that name, if there is one: a fault of the mount is told elsewhere.
  const UserNode* node_of(const Device& d, const char* mount) const {
    for (std::uint32_t i = 0; i < d.family->n_mounts && i < d.mounts.size(); ++i)
      if (std::string_view(d.family->mounts[i].name) == mount && d.mounts[i].node >= 0)
        return &model_.nodes[static_cast<std::size_t>(d.mounts[i].node)];
    return nullptr;
  }
  std::string node_name(const Device& d, const char* mount) const {
    const UserNode* node = node_of(d, mount);
    return node ? node->name : "";
  }
  /// Nodes that never turn against each other have the same axes.
  struct Axes {
    const UserNode* node;
    bool operator==(const Axes& other) const {
      if (!node || !other.node || node == other.node) return true;
      if (node->body != other.node->body || node->shapes.deforms() || other.node->shapes.deforms()) return false;
      const Mat3<double>&a = node->shapes.pose.R, &b = other.node->shapes.pose.R;
      return a.xx == b.xx && a.xy == b.xy && a.xz == b.xz && a.yx == b.yx && a.yy == b.yy && a.yz == b.yz && a.zx == b.zx && a.zy == b.zy &&
             a.zz == b.zz;
    }
  };
  Axes axes(const Device& d, const char* mount) const { return {node_of(d, mount)}; }

  int output_named(const Device& takes, const cardan_port_desc& in, const std::string& source) {
    // A vector of inputs has one place in the file, and one answer.
    const Located& given_at = spec_of(takes).inputs.find(in.name)->second.at;
    const Located at = given_at.key_path.empty() ? spec_.locate(fmt::format("devices.{}.inputs.{}", takes.name, in.name)) : given_at;
    const auto refuse = [&](std::string expected, std::string got, std::string hint) {
      if (given_at.key_path.empty() || refused_.insert(given_at.key_path + " " + source.substr(0, source.rfind('_'))).second)
        fault(Code::bad_connection, at, std::move(expected), std::move(got), std::move(hint));
      return -1;
    };
    const auto dot = source.rfind('.');
    const int giver = devices_.find(source.substr(0, dot));
    std::vector<std::string> legal;
    for (const Device& d : devices_.all)
      for (int k = 0; k < d.n_out; ++k) {
        const cardan_port_desc& out = port(d, CARDAN_PORT_OUT, k);
        legal.push_back(d.name + "." + out.name);
        if (giver < 0 || &devices_.all[static_cast<std::size_t>(giver)] != &d || source.substr(dot + 1) != out.name) continue;
        const std::string given = unit_where(turns(model_, d), out.unit), wanted = unit_where(turns(model_, takes), in.unit);
        if (given != wanted)
          return refuse(fmt::format("an output in {}", wanted), fmt::format("{} in {}", source, given),
                        "both ends of a connection have one unit");
        if (in.frame && out.frame && axes(takes, in.frame) != axes(d, out.frame))
          return refuse("an output in the axes of the node " + node_name(takes, in.frame),
                        fmt::format("{} in those of {}", source, node_name(d, out.frame)),
                        "mount both at one node, or at nodes of one body with the same orientation");
        return d.out + k;
      }
    return refuse(legal.empty() ? std::string("an output of a device, of which there is none") : "an output: " + one_of(legal),
                  in_quotes(source), did_you_mean(source, legal));
  }

  const SystemSpec& spec_;
  const Registry& registry_;
  const Model& model_;
  DiagnosticSink& sink_;
  /// What says of an input whether it holds, where no key of the vehicle file does: by device and input.
  struct Heard {
    std::set<int> outs;
    const DeviceSpec::Input* input = nullptr;  // as which it is connected
    std::vector<int> beside;                   // what it says that of
  };
  std::map<std::pair<int, int>, Heard> heard_;
  std::set<std::string> refused_;  // places of the file, with what was given there
  Devices devices_;
  std::set<std::pair<int, int>> edges_known_;  // fields, and the root of the vehicle where they are read
  bool complete_ = true;
};

}  // namespace

Devices compile_devices(const SystemSpec& spec, const Registry& registry, const Model& model, bool from_home, DiagnosticSink& sink) {
  return DeviceCompiler(spec, registry, model, from_home, sink).run();
}

bool is_far(const Model& model, const double* q, const double* v) {
  return std::ranges::any_of(model.user, [&](const UserBody& u) {
    return is_far(u, {q + u.q, static_cast<std::size_t>(u.nq)}, {v + u.v, static_cast<std::size_t>(u.nv)});
  });
}

Warnings unheeded_validity(const Model& m) {
  Warnings found;
  for (const Device& d : m.devices.all) {
    std::set<int> taken;  // outputs, at once or later
    std::vector<std::pair<int, int>> links;
    const auto take = [&](int in, int out) { taken.insert(out), links.emplace_back(in - d.in, out); };
    for (int in = d.in; in < d.in + d.n_in; ++in) m.devices.each_source(in, [&](int out) { take(in, out); });
    for (const DelayLine& line : m.devices.delays)
      if (line.input >= d.in && line.input < d.in + d.n_in)
        for (const int out : line.outs) take(line.input, out);
    std::map<std::string, std::string> unheeded;  // what says it -> what is taken
    for (const auto& [in, out] : links) {
      const Device& from = m.devices.all[static_cast<std::size_t>(owner_of_output(m.devices, out).first)];
      const cardan_port_desc& given = port_at(*from.family, CARDAN_PORT_OUT, out - from.out);
      if (!given.valid || taken.contains(from.out + place_of_port(*from.family, CARDAN_PORT_OUT, given.valid))) continue;
      std::string& names = unheeded[from.name + "." + given.valid];
      names += (names.empty() ? "" : ", ") + from.name + "." + given.name;
    }
    for (const auto& [says, names] : unheeded)
      found.add(Code::unheeded_validity, m.spec->locate("devices." + d.name + ".inputs"),
                fmt::format("{} takes {} and not {}, which says whether that holds", d.name, names, says),
                fmt::format("a {} that asks for it, or {} read by a script", d.family->type, says));
  }
  return found;
}

}  // namespace cardan
