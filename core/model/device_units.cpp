#include "core/model/device_units.hpp"

#include <mutex>
#include <set>

namespace cardan {
namespace {

const char* kept(std::string text) {
  static std::mutex access;
  static std::set<std::string> all;
  const std::lock_guard lock(access);
  return all.insert(std::move(text)).first->c_str();
}

}  // namespace

bool is_turn(std::string_view rate) { return rate == "rad/s"; }

bool turns(const Model& model, const Device& device) {
  for (const DeviceMount& mount : device.mounts) {
    if (mount.still) return mount.still->turns;
    for (const UserBody& u : model.user)
      if (mount.v >= u.v && mount.v < u.v + u.nv) return is_turn(u.v_units[static_cast<std::size_t>(mount.v - u.v)]);
  }
  return true;
}

bool turns(const SystemSpec& spec, const Registry& registry, const DeviceSpec& device, const cardan_device_family& family) {
  for (std::uint32_t i = 0; i < family.n_mounts; ++i) {
    const auto mount = device.mounts.find(family.mounts[i].name);
    if (family.mounts[i].kind != CARDAN_MOUNT_HINGE || mount == device.mounts.end()) continue;
    const std::string& target = mount->second.target;
    const auto dot = target.find('.');
    const BodySpec* body = spec.find(target.substr(0, dot));
    const cardan_hinge_family* hinge = body ? registry.hinge(body->hinge.type) : nullptr;
    for (std::uint32_t k = 0; hinge && k < hinge->nv; ++k)
      if (dot == std::string::npos || target.substr(dot + 1) == hinge->v_names[k] ||
          (hinge->nq == hinge->nv && target.substr(dot + 1) == hinge->q_names[k]))
        return is_turn(hinge->v_units[k]);
  }
  return true;
}

std::string unit_where(bool turns, std::string_view unit) {
  const auto bar = unit.find('|');
  if (bar == std::string_view::npos) return std::string(unit);
  return std::string(turns ? unit.substr(0, bar) : unit.substr(bar + 1));
}

std::vector<cardan_param_desc> schema_where(bool turns, const cardan_device_family& family) {
  std::vector<cardan_param_desc> schema(family.params, family.params + family.n_params);
  for (cardan_param_desc& p : schema)
    if (p.unit && std::string_view(p.unit).find('|') != std::string_view::npos) p.unit = kept(unit_where(turns, p.unit));
  return schema;
}

bool ticks_late(const Device& d) {
  switch (d.family->role) {
    case CARDAN_ROLE_SENSOR:
      return false;
    case CARDAN_ROLE_ACTUATOR:
    case CARDAN_ROLE_CONTROLLER:
      return true;
    default:
      return d.n_in > 0;
  }
}

const char* role_text(const cardan_device_family& family) {
  constexpr const char* kRoles[] = {"device", "force element", "actuator", "sensor", "controller"};
  return kRoles[family.role];
}

}  // namespace cardan
