#include "core/soa/cost.hpp"

#include <algorithm>
#include <chrono>

#include "core/model/embedding.hpp"
#include "core/soa/counted.hpp"
#include "core/soa/kernels.hpp"
#include "core/soa/program.hpp"
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {
namespace {

const char* name_of(BodyKernel kind) {
  switch (kind) {
    case BodyKernel::fixed:
      return "fixed";
    case BodyKernel::rotation:
      return "rotation";
    case BodyKernel::slide:
      return "slide";
    case BodyKernel::screw:
      return "screw";
    case BodyKernel::free:
      return "free";
    default:
      break;
  }
  if (is_axis(kind)) return "rotation about a coordinate axis";
  return is_general(kind) ? "general" : "dense";
}

const char* name_of(OpCode code) {
  switch (code) {
    case OpCode::hinge_records:
      return "hinge coordinates";
    case OpCode::outward:
      return "outward";
    case OpCode::elastic:
      return "elastic forces";
    case OpCode::world:
      return "world poses";
    case OpCode::central_gravity:
      return "central gravity";
    case OpCode::devices:
      return "devices";
    case OpCode::node_wrenches:
      return "node wrenches";
    case OpCode::keep:
      return "loads kept";
    case OpCode::loops:
      return "closed loops";
    case OpCode::embedding:
      return "inward, outward, closed loops";
    case OpCode::absolute:
      return "all bodies in absolute coordinates";
    case OpCode::inward:
      return "inward";
    case OpCode::refine:
      return "refinement of v'";
    default:
      return "acceleration";
  }
}

}  // namespace

std::vector<OpCost> op_costs(const Model& model, const State& state, std::span<const NodeWrench<double>> wrenches) {
  constexpr Sweeps<Counted> S = make_sweeps<Counted, Wanted::program>();
  Workspace<Counted> ws(model);
  const auto up = [](const Eigen::VectorXd& x) { return std::vector<Counted>(x.data(), x.data() + x.size()); };
  const std::vector<Counted> q = up(state.q), v = up(state.v), zero(static_cast<std::size_t>(model.nv));
  std::vector<Counted> vdot(static_cast<std::size_t>(model.nv));
  std::vector<NodeWrench<Counted>> loads;
  for (const NodeWrench<double>& w : wrenches) loads.push_back({w.node, w.world_axes, {cast<Counted>(w.f.n), cast<Counted>(w.f.f)}});
  Inputs<Counted> in;
  in.q = q.data(), in.v = v.data(), in.tau = zero.data(), in.vdot = zero.data(), in.wrenches = loads;
  S.ground(model, ws, in);
  const Workspace<double> sizes(model);
  std::vector<OpCost> costs;
  for (const Op& op : model.program) {
    Counted::flops = Counted::functions = 0;
    OpCost cost;
    const Run* run = op.run >= 0 ? &model.runs[op.run] : nullptr;
    cost.bodies = run ? run->end - run->begin : static_cast<int>(model.bodies.size()) - 1;
    cost.name = op.code == OpCode::central_gravity && model.field.source ? "gravity of a field" : name_of(op.code);
    run_op(model, op, S, ws, in, vdot.data());
    if (op.code == OpCode::devices) {
      const Devices& d = model.devices;
      cost.bodies = static_cast<int>(d.all.size());
      cost.bytes = static_cast<std::size_t>(d.n_mounts) * (sizeof(cardan_mount_motion) + sizeof(cardan_mount_load)) +
                   static_cast<std::size_t>(2 * d.n_z + d.n_marks + 2 * d.n_in + d.n_out) * sizeof(double);
    }
    if (run) cost.name += std::string(" (") + name_of(run->kind) + ")";
    for (int k = run ? run->begin : 1; run && k < run->end; ++k) cost.bytes += sizes.body_bytes(k);
    const bool counted = op.code != OpCode::devices && op.code != OpCode::keep && op.code != OpCode::loops && op.code != OpCode::absolute;
    cost.flops = op.code == OpCode::embedding ? model.loops.embedding->flops : counted ? Counted::flops : -1;
    cost.functions = Counted::functions;
    costs.push_back(std::move(cost));
  }
  return costs;
}

void measure(const Model& model, const Inputs<double>& in, std::vector<OpCost>& costs, const std::function<void(Workspace<double>&)>& act) {
  using Clock = std::chrono::steady_clock;
  const Sweeps<double>& S = sweeps<double>();
  Workspace<double> ws(model);
  std::vector<double> vdot(static_cast<std::size_t>(model.nv));
  const auto run_until = [&](std::size_t end) {
    S.ground(model, ws, in);
    for (std::size_t i = 0; i < end; ++i)
      if (model.program[i].code != OpCode::devices)
        run_op(model, model.program[i], S, ws, in, vdot.data());
      else if (act)
        act(ws);
  };
  const auto time = [&](std::size_t end) {
    double least = 1e9;
    const auto start = Clock::now();
    const auto seconds = [](Clock::duration d) { return std::chrono::duration<double>(d).count(); };
    int calls = 1;
    do {
      const auto begin = Clock::now();
      for (int i = 0; i < calls; ++i) run_until(end);
      const double taken = seconds(Clock::now() - begin);
      least = std::min(least, taken / calls);
      if (taken < 2e-5) calls *= 2;
    } while (seconds(Clock::now() - start) < 0.1 / static_cast<double>(model.program.size() + 1));
    return 1e9 * least;
  };
  double before = time(0);
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const double now = time(i + 1);
    costs[i].ns = std::max(0.0, now - before);
    before = now;
  }
}

std::size_t workspace_bytes(const Model& model) { return Workspace<double>(model).bytes(); }

}  // namespace cardan::soa
