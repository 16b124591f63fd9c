#include "core/model/doubts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/model/params.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

class Doubts {
 public:
  explicit Doubts(const SystemSpec& spec) : spec_(spec) {}

  Warnings all() {
    for (const BodySpec& body : spec_.bodies) {
      springs(body);
      place(body, body.hinge.body_node, body.hinge.pnode_position, body, ".hinge.at");
      if (const BodySpec* inboard = spec_.find(body.hinge.inboard_body))
        place(*inboard, body.hinge.inboard_node, body.hinge.onode_position, body, ".hinge.to");
    }
    dates();
    if (spec_.loops.empty() && (spec_.loop_form == LoopForm::multipliers || spec_.loop_form == LoopForm::embedding))
      found_.add(Code::no_effect, spec_.locate("loop_form"), "there are no loops to close");
    return std::move(found_);
  }

 private:
  /// t = 0 is one instant, in whatever field.
  void dates() {
    const FieldSpec* first = nullptr;
    for (const FieldSpec& field : spec_.fields) {
      const auto epoch = field.params.find("epoch");
      const std::string* date = epoch == field.params.end() ? nullptr : std::get_if<std::string>(&epoch->second.value);
      if (!date) continue;
      if (!first) first = &field;
      if (const std::string& begun = std::get<std::string>(first->params.find("epoch")->second.value); *date != begun)
        found_.add(Code::unusual_value, spec_.locate(fmt::format("fields.{}.epoch", field.name)),
                   fmt::format("t = 0 is {} here and {} for {}", *date, begun, first->name), "one date of t = 0, in the same words");
    }
  }
  void springs(const BodySpec& body) {
    const HingeSpec& hinge = body.hinge;
    if (hinge.locked && std::any_of(hinge.v.begin(), hinge.v.end(), [](double v) { return v != 0.0; }))
      found_.add(Code::no_effect, spec_.locate(body_path(body) + ".hinge.initial"),
                 fmt::format("the hinge is locked: its initial velocity ({:g}) is not taken", fmt::join(hinge.v, ", ")));
    if (hinge.locked && hinge.factor != HingeFactor::cholesky)
      found_.add(Code::no_effect, spec_.locate(body_path(body) + ".hinge.factor"), "the hinge is locked: it has no inertia to factor");
    for (std::size_t i = 0; i < hinge.springs.size(); ++i) {
      const SpringDamper& s = hinge.springs[i];
      const std::string path = s.at.key_path.empty() ? fmt::format("{}.hinge.springs[{}]", body_path(body), i) : s.at.key_path;
      if (!hinge.locked && s.stiffness < 0.0)
        found_.add(Code::unusual_value, spec_.locate(path + ".stiffness"),
                   fmt::format("stiffness {:g}: tau = -stiffness (q - rest) pushes away from rest, and the motion grows", s.stiffness),
                   "a restoring spring has a stiffness > 0");
    }
  }

  /// A hinge of `body` at a place of `flexible` that is no node: it stays with the undeformed frame.
  void place(const BodySpec& flexible, const std::string& node, const Eigen::Vector3d& position, const BodySpec& body, const char* key) {
    if (!flexible.modal || flexible.modal->n_modes == 0 || !node.empty() || position.isZero(0.0)) return;
    std::string nodes;
    for (const ModalNode& n : flexible.modal->nodes) nodes += (nodes.empty() ? "" : ", ") + n.name;
    found_.add(
        Code::frame_attachment, spec_.locate(body_path(body) + key),
        fmt::format(
            "the hinge is fixed to the undeformed frame of {}, {:.4g} m from its origin: bending of {} does not move this point, and "
            "forces there bend nothing",
            flexible.name, position.norm(), flexible.name),
        fmt::format("give the point a node in {}.modal and name that{}", body_path(flexible),
                    nodes.empty() ? "" : fmt::format(" (there are: {})", nodes)));
  }

  const SystemSpec& spec_;
  Warnings found_;
};

}  // namespace

Warnings doubts(const SystemSpec& spec) { return Doubts(spec).all(); }

namespace {

void add_passed_stops(const Model& m, const double* q, Warnings& found) {
  for (const HingeLoad& load : m.loads) {
    if (load.law != HingeLaw::stop) continue;
    const UserBody& u = *std::ranges::find_if(m.user, [&](const UserBody& b) { return load.q >= b.q && load.q < b.q + b.nq; });
    const std::string& component = u.q_names[static_cast<std::size_t>(load.q - u.q)];
    for (const int side : {-1, 1}) {
      const double limit = load.p[side < 0 ? 0 : 1], beyond = side * (q[load.q] - limit);
      if (std::isfinite(limit) && beyond > 1e-6 * std::max(1.0, std::abs(limit)))
        found.add(Code::unusual_value, m.spec->locate("bodies." + u.name + ".hinge"),
                  fmt::format("{} begins {:.3g} beyond its {} stop at {:.6g}", component, beyond, side < 0 ? "lower" : "upper", limit),
                  "the stop pushes it back from there with all its stiffness: another initial value, or another limit");
    }
  }
}

/// What pushes two nodes against each other needs two that move against each other.
void add_idle_devices(const Model& m, Warnings& found) {
  const auto pushes = [](const DeviceMount& mount) { return mount.node >= 0 && (mount.use & CARDAN_USE_LOAD) != 0; };
  const auto stands = [](const DeviceMount& mount) { return mount.node < 0 && mount.v < 0 && mount.field < 0; };  // at the world
  for (const Device& d : m.devices.all) {
    if ((d.family->facts & CARDAN_FACT_INTERNAL) == 0 || d.mounts.size() != 2) continue;
    if (std::ranges::all_of(d.mounts, stands))
      found.add(Code::no_effect, m.spec->locate("devices." + d.name),
                fmt::format("{} and {} are both at the world: it pushes nothing", d.family->mounts[0].name, d.family->mounts[1].name),
                "a node of a body");
    if (!std::ranges::all_of(d.mounts, pushes)) continue;
    const auto body = [&](std::size_t i) { return m.nodes[static_cast<std::size_t>(d.mounts[i].node)].body; };
    const UserBody& u = m.user[static_cast<std::size_t>(body(0))];
    if (body(0) == body(1) && (u.n_modes == 0 || d.mounts[0].node == d.mounts[1].node))
      found.add(Code::no_effect, m.spec->locate("devices." + d.name),
                fmt::format("{} and {} are on {} and do not move against each other: what it pushes with cancels", d.family->mounts[0].name,
                            d.family->mounts[1].name, u.name),
                "a node of another body, or another one of a flexible body");
  }
}

/// What was given leaves loops open by a few digits.
void add_given_that_moved(const Model& m, Warnings& found) {
  const MovedAtStart* most = nullptr;
  const auto part = [](const MovedAtStart& x) { return std::abs(x.found - x.given) / std::max(1.0, std::abs(x.given)); };
  int others = -1;
  for (const MovedAtStart& x : m.loops.moved)
    if (x.described) {
      ++others;
      if (!most || part(x) > part(*most)) most = &x;
    }
  if (most)
    found.add(
        Code::unusual_value, m.spec->locate("bodies." + most->name.substr(0, most->name.find('.')) + ".hinge"),
        fmt::format("{} begins with {:.9g} {}{}: as they were given ({:.9g} {}) loops are open by more than 1e-6 of their size", most->name,
                    most->found, most->unit, others > 0 ? fmt::format(", and {} others elsewhere", others) : "", most->given, most->unit),
        "more digits of places, axes and `initial`, or no `initial` where it follows from that of others: it is found then");
}

}  // namespace

// The nearest rates that close a loop at a body that moves fast and another that was given none make that one turn about its lever.
Warnings fast_found_rates(const Model& m, const std::vector<MovedAtStart>& moved, const double* v) {
  constexpr double kFast = 100.0;  // [rad/s], and times the fastest that was given
  double given = 0.0, fastest = 0.0;
  const MovedAtStart* which = nullptr;
  const UserBody* body = nullptr;
  for (const UserBody& u : m.user)
    for (int i = 0; i < u.nv; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (u.v_units[at] != "rad/s") continue;
      const auto x = std::ranges::find(moved, u.name + "." + u.v_names[at], &MovedAtStart::name);
      const double rate = v[u.v + i];
      const bool found = x != moved.end() && std::abs(rate - x->found) <= 1e-9 * std::abs(rate);
      given = std::max(given, std::abs(found ? x->given : rate));
      if (found && std::abs(rate) > fastest) fastest = std::abs(rate), which = &*x, body = &u;
    }
  Warnings told;
  if (fastest > kFast && fastest > kFast * given)
    told.add(Code::unusual_value, m.spec->locate("bodies." + body->name + ".hinge"),
             fmt::format("{} begins with {:.4g} rad/s: of the rates that keep the loops closed these are the nearest to the given ones, "
                         "none of which is above {:.3g} rad/s",
                         which->name, which->found, given),
             fmt::format("give `initial` of {} the velocity with which it is to begin", body->name));
  return told;
}

Warnings doubts_at_start(const Model& model, const double* q, const double* v) {
  Warnings found;
  add_passed_stops(model, q, found);
  add_idle_devices(model, found);
  add_given_that_moved(model, found);
  found.add(fast_found_rates(model, model.loops.moved, v));
  return found;
}

Warnings idle_at_hinges(const Model& model, const std::vector<std::string>& but) {
  Warnings found;
  for (const Device& d : model.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      if (!d.mounts[i].still) continue;
      const std::string& target =
          model.spec->devices[static_cast<std::size_t>(d.spec)].mounts.find(d.family->mounts[i].name)->second.target;
      if (std::ranges::find(but, target.substr(0, target.find('.'))) == but.end())
        found.add(Code::no_effect, model.spec->locate(fmt::format("devices.{}.{}", d.name, d.family->mounts[i].name)),
                  fmt::format("the hinge of {} is locked: it is read at rest, and to push there has no effect", in_quotes(target)));
    }
  return found;
}

std::vector<std::string> keys_not_read(const Model& model, const Device& device) {
  const cardan_device_family& f = *device.family;
  return keys_not_read(*model.spec, {"devices." + device.name, f.type, model.spec->devices[static_cast<std::size_t>(device.spec)].params},
                       {{f.params, f.n_params}, f.params_size, f.pack, f.packed_size});
}

Warnings idle_keys(const Model& model) {
  Warnings found;
  const auto tell = [&](const char* kind, const std::string& name, const ParamValues& given, const std::vector<std::string>& not_read) {
    for (const std::string& key : not_read)
      if (given.contains(key))
        found.add(Code::no_effect, model.spec->locate(fmt::format("{}.{}.{}", kind, name, key)),
                  fmt::format("`{}` does not apply to {} as its other keys choose it", key, name));
  };
  for (const Device& d : model.devices.all)
    tell("devices", d.name, model.spec->devices[static_cast<std::size_t>(d.spec)].params, keys_not_read(model, d));
  for (std::size_t i = 0; i < model.spec->fields.size(); ++i) {
    const FieldSpec& given = model.spec->fields[i];
    const cardan_field_family& f = *model.fields[i].source->family;
    tell("fields", given.name, given.params,
         keys_not_read(*model.spec, {"fields." + given.name, f.type, given.params},
                       {{f.params, f.n_params}, f.params_size, f.pack, f.packed_size}));
  }
  return found;
}

Warnings held_back(const SystemSpec& spec, const std::vector<std::string>& but) {
  Warnings found;
  for (const BodySpec& body : spec.bodies) {
    const HingeSpec& hinge = body.hinge;
    if (!hinge.locked || std::ranges::find(but, body.name) != but.end()) continue;
    const auto tell = [&](const Located& at, const char* key, std::size_t i, const char* what) {
      const std::string path = at.key_path.empty() ? fmt::format("{}.hinge.{}[{}]", body_path(body), key, i) : at.key_path;
      found.add(Code::no_effect, spec.locate(path), fmt::format("the hinge is locked: {}", what));
    };
    for (std::size_t i = 0; i < hinge.loads.size(); ++i) tell(hinge.loads[i].at, "loads", i, "this load does nothing");
    for (std::size_t i = 0; i < hinge.springs.size(); ++i) tell(hinge.springs[i].at, "springs", i, "this spring and damper do nothing");
  }
  return found;
}

}  // namespace cardan
