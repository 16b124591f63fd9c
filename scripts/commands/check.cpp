#include <fmt/format.h>

#include "core/model/doubts.hpp"
#include "core/sim/expected_stiffness.hpp"
#include "core/sim/loop_doubts.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/gathered_warnings.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/mission/examine.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

std::string count(std::size_t n, const char* what) { return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s"); }
std::string bodies(std::size_t n) { return n == 1 ? "1 body" : fmt::format("{} bodies", n); }

}  // namespace

void add_check(CommandLine& line) {
  Command& command = line.command("check", "Validate a scenario without running it");
  auto arguments = std::make_shared<ScenarioArguments>();
  arguments->add_to(command, line);
  command.action([arguments] {
    ScenarioOptions options = arguments->options();
    bool quiet = false;
    options.print = [&quiet, print = options.print](std::string_view text) {
      if (!quiet) print(text);
    };
    const auto s = open_scenario(options);
    try_start(*s);
    s->warnings.add(expected_stiffness(s->model, s->sim->state().q.data(), s->mission.simulation.integrator, shortest_interval(*s),
                                       s->mission.duration));
    s->warnings.add(doubts_at_start(*s->model, s->sim->state().q.data(), s->sim->state().v.data()));
    s->warnings.add(loops_far_from_home(*s->sim));
    s->warnings.add(open_rows_of_loops(*s->model, s->sim->state().q, s->sim->state().v, s->sim->drives().data()));
    quiet = true;  // what functions of the run say is said in a run
    const std::vector<std::string> elsewhere = kept_elsewhere_at_start(*s);
    s->warnings.add(measures_at_start(*s));
    fmt::print("ok: {}, {} coordinates, {} velocities, {}, {}, {}, {}{}, {:g} s{}\n", bodies(s->model->user.size()), s->model->nq,
               s->model->nv, count(static_cast<std::size_t>(s->model->n_modes), "mode"), count(s->controllers.size(), "controller"),
               count(s->events.size(), "event"), count(s->checks.size(), "check"),
               s->sequences.empty() ? "" : ", " + count(s->sequences.all().size(), "sequence"), s->mission.duration,
               s->warnings.empty() ? "" : fmt::format(", {}", count(s->warnings.all().size(), "warning")));
    if (!elsewhere.empty() && s->mission.checkpoint_period) fmt::print("{}", kept_elsewhere_text(elsewhere));
    complain(told(s->warnings));
    return 0;
  });
}

}  // namespace cardan
