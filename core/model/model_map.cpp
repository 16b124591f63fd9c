#include "core/model/model_map.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <unordered_map>

namespace cardan {
namespace {

/// `n` numbers from `a` on in the first are those from `b` on in the second.
void join(std::vector<int>& map, int a, int b, int n) { std::iota(map.begin() + a, map.begin() + a + n, b); }

const FlexibleBody& flexible(const Model& m, const UserBody& u) { return m.flexible[m.bodies[u.sweep].flexible]; }

/// A modal coordinate means the same in both where it has the same mass and stiffness.
bool same_mode(const Model& from, const UserBody& a, const Model& to, const UserBody& b, int mode) {
  const auto of = [mode](const Model& m, const UserBody& u) {
    const FlexibleBody& f = flexible(m, u);
    return std::pair(f.M_ee[mode * u.n_modes + mode], f.K[f.K_diagonal ? mode : mode * u.n_modes + mode]);
  };
  const auto near = [](double x, double y) { return std::abs(x - y) <= 1e-9 * std::max(std::abs(x), std::abs(y)); };
  const auto [mass, stiffness] = of(from, a);
  const auto [other_mass, other_stiffness] = of(to, b);
  return near(mass, other_mass) && near(stiffness, other_stiffness);
}

/// Where each name is in `all`.
template <class Named>
std::unordered_map<std::string_view, int> places_of(const std::vector<Named>& all) {
  std::unordered_map<std::string_view, int> places;
  places.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) places.emplace(all[i].name, static_cast<int>(i));
  return places;
}

int place_of(const std::string& name, const std::unordered_map<std::string_view, int>& places) {
  const auto found = places.find(name);
  return found == places.end() ? -1 : found->second;
}

std::vector<int> nowhere(int n) { return std::vector<int>(static_cast<std::size_t>(n), -1); }

}  // namespace

ModelMap model_map(const Model& from, const Model& to) {
  ModelMap map{{},
               {},
               {},
               nowhere(from.nq),
               nowhere(from.nv),
               nowhere(from.devices.n_z),
               nowhere(from.devices.n_marks),
               nowhere(from.devices.n_in),
               nowhere(from.devices.n_out)};
  const auto bodies = places_of(to.user), nodes = places_of(to.nodes);
  for (const UserBody& a : from.user) {
    map.body.push_back(place_of(a.name, bodies));
    if (map.body.back() < 0) continue;
    const UserBody& b = to.user[map.body.back()];
    if (a.hinge_type == b.hinge_type && a.nq == b.nq && a.nv == b.nv) join(map.q, a.q, b.q, a.nq), join(map.v, a.v, b.v, a.nv);
    for (int i = 0; i < std::min(a.n_modes, b.n_modes); ++i)
      if (same_mode(from, a, to, b, i)) map.q[a.eta + i] = b.eta + i, map.v[a.etadot + i] = b.etadot + i;
  }
  for (const UserNode& n : from.nodes) map.node.push_back(place_of(n.name, nodes));
  for (const Device& a : from.devices.all) {
    map.device.push_back(to.devices.find(a.name));
    if (map.device.back() < 0) continue;
    const Device& b = to.devices.all[map.device.back()];
    if (a.family != b.family) continue;
    join(map.z, a.z, b.z, static_cast<int>(a.family->n_states)), join(map.mark, a.mark, b.mark, static_cast<int>(a.family->n_marks));
    join(map.in, a.in, b.in, a.n_in), join(map.out, a.out, b.out, a.n_out);
  }
  return map;
}

ModelMap identity(const Model& model) { return model_map(model, model); }

ModelMap then(const ModelMap& first, const ModelMap& second, const Model& last) {
  ModelMap both = first;
  const auto go_on = [](std::vector<int>& map, const std::vector<int>& next, int n) {
    for (int& i : map) i = i < 0 ? -1 : next[i];
    for (int i = 0; i < n; ++i)
      if (std::ranges::find(map, i) == map.end()) map.push_back(i);
  };
  const Devices& d = last.devices;
  go_on(both.body, second.body, static_cast<int>(last.user.size())), go_on(both.node, second.node, static_cast<int>(last.nodes.size()));
  go_on(both.device, second.device, static_cast<int>(d.all.size()));
  go_on(both.q, second.q, last.nq), go_on(both.v, second.v, last.nv);
  go_on(both.z, second.z, d.n_z), go_on(both.mark, second.mark, d.n_marks);
  go_on(both.in, second.in, d.n_in), go_on(both.out, second.out, d.n_out);
  return both;
}

int id_of(const std::vector<int>& map, int index) { return static_cast<int>(std::ranges::find(map, index) - map.begin()); }

State carried(const State& state, const ModelMap& map, const Model& to) {
  State out = to.initial_state();
  out.t = state.t;
  const auto carry = [](const Eigen::VectorXd& x, const std::vector<int>& where, Eigen::VectorXd& y) {
    for (std::size_t i = 0; i < where.size(); ++i)
      if (where[i] >= 0) y[where[i]] = x[static_cast<Eigen::Index>(i)];
  };
  carry(state.q, map.q, out.q), carry(state.v, map.v, out.v), carry(state.z, map.z, out.z), carry(state.marks, map.mark, out.marks);
  return out;
}

}  // namespace cardan
