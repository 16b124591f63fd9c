#include "core/soa/cost.hpp"

#include "core/soa/counted.hpp"
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {
namespace {

const char* name_of(KernelKind kind) {
  switch (kind) {
    case KernelKind::fixed: return "fixed";
    case KernelKind::rotation: return "rotation";
    case KernelKind::slide: return "slide";
    case KernelKind::screw: return "screw";
    case KernelKind::free: return "free";
    default: break;
  }
  if (is_axis(kind)) return "rotation about a coordinate axis";
  return is_general(kind) ? "general" : "dense";
}

}  // namespace

std::vector<OpCost> op_costs(const Model& model, const State& state) {
  constexpr Sweeps<Counted> S = make_sweeps<Counted>();
  Workspace<Counted> ws(model);
  const auto up = [](const Eigen::VectorXd& x) { return std::vector<Counted>(x.data(), x.data() + x.size()); };
  const std::vector<Counted> q = up(state.q), v = up(state.v), zero(static_cast<std::size_t>(model.nv));
  std::vector<Counted> vdot(static_cast<std::size_t>(model.nv));
  Inputs<Counted> in;
  in.q = q.data(), in.v = v.data(), in.tau = zero.data(), in.vdot = zero.data();
  S.ground(model, ws, in);
  std::vector<OpCost> costs;
  for (const Op& op : model.program) {
    Counted::flops = Counted::functions = 0;
    OpCost cost;
    const Run* run = op.run >= 0 ? &model.runs[static_cast<std::size_t>(op.run)] : nullptr;
    cost.bodies = run ? run->end - run->begin : static_cast<int>(model.bodies.size()) - 1;
    switch (op.kernel) {
      case Kernel::hinge_records: cost.name = "hinge coordinates", S.hinge_records(model, ws, in); break;
      case Kernel::outward: cost.name = "outward", S.outward(model, ws, in, *run, {.vdot = is_general(run->kind) && model.has_prescribed()}); break;
      case Kernel::elastic: cost.name = "elastic forces", S.elastic(model, ws, in); break;
      case Kernel::world: cost.name = "world poses", S.world(model, ws, in); break;
      case Kernel::central_gravity: cost.name = "central gravity", S.central_gravity(model, ws, in); break;
      case Kernel::node_wrenches: cost.name = "node wrenches", S.node_wrenches(model, ws, in); break;
      case Kernel::inward: cost.name = "inward", S.inward(model, ws, in, *run, {}); break;
      case Kernel::acceleration: cost.name = "acceleration", S.acceleration(model, ws, in, *run, vdot.data()); break;
    }
    if (run) cost.name += std::string(" (") + name_of(run->kind) + ")";
    cost.flops = Counted::flops;
    cost.functions = Counted::functions;
    costs.push_back(std::move(cost));
  }
  return costs;
}

std::size_t workspace_bytes(const Model& model) { return Workspace<double>(model).bytes(); }

}  // namespace cardan::soa
