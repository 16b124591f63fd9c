#include "core/sim/loop_doubts.hpp"

#include <fmt/format.h>

#include <limits>

#include "core/dynamics/loops.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

Warnings loops_far_from_home(Simulation& sim) {
  constexpr double eps = std::numeric_limits<double>::epsilon(), kWell = 1e-10;  // rounding of places over the size of a loop
  Warnings found;
  const Model& m = sim.model();
  for (const Loop& loop : m.loops.all) {
    if (loop.home != 0 || loop.closing == Closing::coupling || loop.from.node < 0 || loop.to.node < 0) continue;
    const double away = sim.observe().node(loop.from.node).position.norm();
    if (!(eps * away > kWell * loop.lever)) continue;
    const auto carrier = [&m](const LoopEnd& end) {
      return m.user[static_cast<std::size_t>(m.nodes[static_cast<std::size_t>(end.node)].body)].name;
    };
    found.add(
        Code::unusual_value, m.spec->locate("loops." + loop.name),
        fmt::format("its ends are counted from the origin of the world, {:.2g} m away, and known to {:.1g} m: rounding there sets the "
                    "steps of what is stiff",
                    away, eps * away),
        fmt::format("{} and {} on one tree: the base of one on a free hinge to the other in place of the world", carrier(loop.from),
                    carrier(loop.to)));
  }
  return found;
}

Warnings open_rows_of_loops(const Model& m, const Eigen::VectorXd& q, const Eigen::VectorXd& v, const LoopDrive* drives) {
  Warnings found;
  for (const RowLeftOpen& row : rows_left_open(m, q, v, drives))
    found.add(Code::unusual_value, m.spec->locate("loops." + m.loops.all[static_cast<std::size_t>(row.loop)].name), row.what,
              "more digits of lengths, places and axes, as far as they are typed; or a type that holds less: `cardan describe` names what "
              "could be set free");
  return found;
}

}  // namespace cardan
