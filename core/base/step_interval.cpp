#include "core/base/step_interval.hpp"

namespace cardan {

std::vector<StepInterval::Column> StepInterval::columns() const {
  const auto n = [](long count) { return static_cast<double>(count); };
  std::vector<Column> all = {{"begin", "s", begin},
                             {"end", "s", end},
                             {"steps", "1", n(steps)},
                             {"evaluations", "1", n(evaluations)},
                             {"by_error", "1", n(by_error)},
                             {"by_stop", "1", n(by_stop)},
                             {"shortest", "s", shortest},
                             {"longest", "s", longest},
                             {"order", "1", steps > 0 ? n(orders) / n(steps) : 0.0},
                             {"rejected_mechanical", "1", n(rejected.by_error[0])},
                             {"rejected_modal", "1", n(rejected.by_error[1])},
                             {"rejected_devices", "1", n(rejected.by_error[2])},
                             {"rejected_not_evaluated", "1", n(rejected.not_evaluated)},
                             {"rejected_not_converged", "1", n(rejected.not_converged)}};
  constexpr std::array causes{"start", "tick", "event", "corner", "loops", "checkpoint", "vehicle"};
  for (std::size_t i = 0; i < restarts.size(); ++i) all.push_back({std::string("restarts_") + causes[i], "1", n(restarts[i])});
  all.push_back({"of_worst", "1", n(of_worst)});
  return all;
}

}  // namespace cardan
