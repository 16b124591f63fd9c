#include "scripts/mission/workbench.hpp"

namespace cardan {

void Workbench::set_state(State state) {
  s_.model->normalise(state.q.data());
  s_.use_model(s_.model);  // a simulation that has not begun, without what the run had put into it
  run_.reset();
  s_.sim->set_state(state);
  s_.look_at_state();
  s_.stage = Scenario::Stage::setup;
  s_.phase = {};
  s_.wanted_phase.reset();
  s_.sequences.begin(false, {});
}

void Workbench::run_to(double t, const std::function<void(double)>& between_steps) {
  struct Running {
    bool& flag;
    explicit Running(bool& f) : flag(f) { flag = true; }
    ~Running() { flag = false; }
  } const scope(running_);
  if (!run_) run_ = std::make_unique<MissionRun>(s_, recorder_, std::vector<Output>());
  run_->run(t, between_steps);
}

}  // namespace cardan
