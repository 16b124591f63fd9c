#include "core/abi/port_vectors.hpp"

#include <algorithm>

namespace cardan {
namespace {

bool alike(const cardan_port_desc& a, const cardan_port_desc& b) {
  const auto same = [](const char* x, const char* y) { return x == y || (x && y && std::string_view(x) == y); };
  return same(a.unit, b.unit) && same(a.frame, b.frame);
}

}  // namespace

std::vector<PortVector> port_vectors(const cardan_device_family& family, std::uint32_t kind) {
  std::vector<const cardan_port_desc*> ports;
  for (std::uint32_t i = 0; i < family.n_ports; ++i)
    if (family.ports[i].kind == kind) ports.push_back(&family.ports[i]);
  std::vector<PortVector> all;
  for (std::size_t i = 0; i < ports.size();) {
    const std::string_view head = ports[i]->name;
    const std::size_t bar = head.rfind('_');
    PortVector v{std::string(bar == std::string_view::npos ? "" : head.substr(0, bar)), static_cast<int>(i), {}};
    const auto take = [&](const std::string& suffix) {
      const std::size_t next = i + v.suffixes.size();
      const bool taken = next < ports.size() && ports[next]->name == v.name + suffix && alike(*ports[next], *ports[i]);
      if (taken) v.suffixes.push_back(suffix);
      return taken;
    };
    if (v.name.empty() || !(take("_x") && take("_y") && take("_z"))) {
      v.suffixes.clear();
      for (int k = 1; !v.name.empty() && take("_" + std::to_string(k));) ++k;
    }
    const bool is_port = std::ranges::any_of(ports, [&](const cardan_port_desc* p) { return p->name == v.name; });
    if (v.suffixes.size() < 2 || is_port) {
      ++i;
      continue;
    }
    i += v.suffixes.size();
    all.push_back(std::move(v));
  }
  return all;
}

const cardan_port_desc& port_at(const cardan_device_family& family, std::uint32_t kind, int place) {
  for (std::uint32_t i = 0;; ++i)
    if (family.ports[i].kind == kind && place-- == 0) return family.ports[i];
}

int place_of_port(const cardan_device_family& family, std::uint32_t kind, std::string_view name) {
  int place = 0;
  for (std::uint32_t i = 0; i < family.n_ports; ++i) {
    if (family.ports[i].kind != kind) continue;
    if (name == family.ports[i].name) return place;
    ++place;
  }
  return -1;
}

}  // namespace cardan
