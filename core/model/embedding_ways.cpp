#include <fmt/format.h>

#include <algorithm>

#include "core/model/embedding_stages.hpp"

namespace cardan::embedding_stages {

Ways::Ways(const Model& m, const std::vector<double>& scaled_rows)
    : model(m), rows(scaled_rows), body_of(at(m.nv)), stops(m.bodies.size()) {
  for (std::size_t k = 1; k < m.bodies.size(); ++k)
    for (int j = 0; j < m.bodies[k].nv; ++j) body_of[at(m.bodies[k].v + j)] = static_cast<int>(k);
  const std::size_t n = m.loops.all.size();
  hinges.resize(n), home.resize(n), meets.resize(n);
  for (std::size_t l = 0; l < n; ++l) {
    const Loop& loop = m.loops.all[l];
    std::vector<int>& on = hinges[l];
    home[l] = loop.home;
    if (loop.closing == Closing::coupling) {
      for (const CoupledRate& term : loop.coupling.terms)
        if (const int k = body_of[at(term.v)]; std::ranges::find(on, k) == on.end()) on.push_back(k);
      home[l] = body(on[0]).parent;
      for (const int k : on) home[l] = ancestor(home[l], body(k).parent);
    } else {
      on = loop.from_path;
      on.insert(on.end(), loop.to_path.begin(), loop.to_path.end());
    }
    std::ranges::sort(on);
    meets[l] = meets_modes_of_home(static_cast<int>(l));
    if (loop.closing == Closing::coupling) stop_at_gaps(static_cast<int>(l));
  }
}

int Ways::ancestor(int a, int b) const {
  while (a != b) (a > b ? a : b) = body(std::max(a, b)).parent;
  return a;
}

/// The modes of home move one end against the other, or what moves them pushes these modes.
bool Ways::meets_modes_of_home(int l) const {
  const int of = home[at(l)];
  if (body(of).n_modes == 0) return false;
  const auto ends_there = [&](const LoopEnd& end) { return end.sweep == of && deforms(end); };
  if (loop(l).closing != Closing::coupling && (ends_there(loop(l).from) || ends_there(loop(l).to))) return true;
  return std::ranges::any_of(hinges[at(l)], [&](int k) {
    while (body(k).parent != of) k = body(k).parent;
    return body(k).onode >= 0;
  });
}

/// A coupling may leave out hinges on the way from those that it has to where they part. What another loop moves such a body by is then
/// counted from its inboard body: coordinates of the coupling pass there, and are eliminated at home, where they must have all that is
/// theirs.
void Ways::stop_at_gaps(int l) {
  const auto has = [&](int k) { return k == home[at(l)] || std::ranges::binary_search(hinges[at(l)], k); };
  for (int k : hinges[at(l)])
    for (; k != home[at(l)]; k = body(k).parent)
      if (has(k) != has(body(k).parent)) stops[at(k)] = 1;
}

bool Ways::shifts(int k) const {
  const Mat3<double>& R = body(k).O.R;
  return body(k).kind == BodyKernel::slide && R.xx == 1.0 && R.yy == 1.0 && R.zz == 1.0 && R.xy == 0.0 && R.xz == 0.0 && R.yx == 0.0 &&
         R.yz == 0.0 && R.zx == 0.0 && R.zy == 0.0;
}

std::string Ways::modes_on_the_way(int l) const {
  const auto name = [&](int k) { return model.user[at(model.owner[at(k)])].name; };
  for (const int k : hinges[at(l)]) {
    if (body(k).n_modes > 0) return fmt::format("{}: {} is flexible", loop(l).name, name(k));
    if (body(k).onode >= 0) return fmt::format("{}: {} hangs on a flexible body", loop(l).name, name(k));
  }
  if (meets[at(l)]) return fmt::format("{}: {} is flexible", loop(l).name, name(home[at(l)]));
  return {};
}

}  // namespace cardan::embedding_stages
