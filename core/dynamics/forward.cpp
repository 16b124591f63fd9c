#include "core/dynamics/forward.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "core/dynamics/loops.hpp"
#include "core/model/loops.hpp"
#include "core/soa/kernels_tangent.hpp"
#include "core/soa/program.hpp"

namespace cardan {
namespace {

/// The ops of closed loops; other ops: true.
bool run_loops(const Model& model, const Op& op, Workspace& ws, const Inputs& in, double* vdot) {
  if (op.code == OpCode::keep) keep_loads(model, ws);
  if (op.code == OpCode::embedding) return run_embedding(model, ws, in, vdot);
  if (op.code == OpCode::absolute) return run_absolute(model, ws, in, vdot);
  return op.code != OpCode::loops || close_loops(model, ws, in, vdot);
}
template <class T>
bool run_loops(const Model& model, const Op& op, soa::Workspace<T>&, const soa::Inputs<T>&, T*) {
  if (op.code == OpCode::loops || op.code == OpCode::embedding || op.code == OpCode::absolute)
    require_open_tree(model, "lanes and derivatives");
  return true;
}

}  // namespace

template <class T>
bool forward_dynamics(const Model& model, soa::Workspace<T>& ws, const soa::Inputs<T>& in, T* vdot, StateLoads<T>* loads) {
  const soa::Sweeps<T>& S = soa::sweeps<T>();
  const std::size_t bytes = sizeof(T) * static_cast<std::size_t>(model.nq);
  // q is null where nq = 0. P is a function of q alone unless masses vary.
  const bool kept = model.rigid && bytes > 0 && model.varies.empty() && !model.loops.embedding && !model.loops.absolute;
  const bool again = kept && ws.articulated && std::memcmp(in.q, ws.articulated_q.data(), bytes) == 0;
  ws.articulated = again;  // an evaluation that breaks off leaves nothing to be used again
  S.ground(model, ws, in);
  for (const Op& op : model.program) {
    if (op.code == OpCode::devices) {
      if (loads && !loads->act(ws, in)) return false;
      continue;
    }
    soa::run_op(model, op, S, ws, in, vdot, again);
    if (!run_loops(model, op, ws, in, vdot)) return false;
    if (ws.breakdown.body != 0) return false;
  }
  if (kept && !again) std::memcpy(static_cast<void*>(ws.articulated_q.data()), in.q, bytes);
  ws.articulated = kept;
  return !loads || loads->follow(ws, in, vdot);
}
template bool forward_dynamics(const Model&, soa::Workspace<double>&, const soa::Inputs<double>&, double*, StateLoads<double>*);
template bool forward_dynamics(const Model&, soa::Workspace<soa::Lanes<2>>&, const soa::Inputs<soa::Lanes<2>>&, soa::Lanes<2>*,
                               StateLoads<soa::Lanes<2>>*);
template bool forward_dynamics(const Model&, soa::Workspace<soa::Lanes<4>>&, const soa::Inputs<soa::Lanes<4>>&, soa::Lanes<4>*,
                               StateLoads<soa::Lanes<4>>*);
template bool forward_dynamics(const Model&, soa::Workspace<soa::Lanes<8>>&, const soa::Inputs<soa::Lanes<8>>&, soa::Lanes<8>*,
                               StateLoads<soa::Lanes<8>>*);
template bool forward_dynamics(const Model&, soa::Workspace<soa::Tangent>&, const soa::Inputs<soa::Tangent>&, soa::Tangent*,
                               StateLoads<soa::Tangent>*);

namespace {

/// A body on `root` or outboard of it whose mass matrix is not that of its deformed shape (docs/mathematics/flexible.md, 2); empty: none.
std::string truncated_outboard(const Model& model, int root) {
  for (int k = static_cast<int>(model.bodies.size()) - 1; k >= root; --k) {
    const SweepBody& body = model.bodies[static_cast<std::size_t>(k)];
    if (body.n_modes == 0 || model.flexible[static_cast<std::size_t>(body.flexible)].level >= 2) continue;
    int inboard = k;
    while (inboard > root) inboard = model.bodies[static_cast<std::size_t>(inboard)].parent;
    if (inboard == root) return model.user[static_cast<std::size_t>(model.owner[static_cast<std::size_t>(k)])].name;
  }
  return "";
}

}  // namespace

RunFailure describe_breakdown(const Model& model, const soa::Breakdown& bad, double t) {
  RunFailure f{Code::singular_hinge, t, "", "", "", "", ""};
  if (bad.row >= 0) {
    const Loop& loop = *std::ranges::find_if(model.loops.all, [&](const Loop& l) { return bad.row < l.first + l.rows; });
    f.code = Code::loop_failed;
    f.body = loop.name;
    f.what = fmt::format("row {} of loop {}: residual {:.3g}, limit {:.3g}", bad.row - loop.first + 1, loop.name, bad.value, bad.limit);
    f.hint = "it contradicts other loops or given motions, or its ends are out of reach of each other; see docs/errors.md";
    return f;
  }
  const UserBody& u = model.user[model.owner[bad.body]];
  f.body = u.name;
  f.hinge = u.name + "." + u.hinge_type;
  const bool mode = bad.component < 0;
  if (mode) f.code = Code::singular_mass;
  const std::string direction = mode ? "its modes" : u.v_names[bad.component];
  f.what = fmt::format("{} = {:.3g}, limit {:.3g}, direction: {}", mode ? "modal inertia" : "D", bad.value, bad.limit, direction);
  f.hint = "a body without mass or inertia in that direction, or a value that is not finite; see docs/errors.md";
  const int v = model.bodies[static_cast<std::size_t>(bad.body)].v + bad.component;
  if (!mode && std::ranges::any_of(model.loops.all, [v](const Loop& l) { return std::ranges::find(l.rates, v) != l.rates.end(); }))
    f.hint =
        "closed loops may be all that moves it: closed by rates (`loop_form: auto`, and no modes on their way) they need no inertia there; "
        "else give the body one, or its hinge fewer freedoms";
  if (const std::string deformed = truncated_outboard(model, bad.body); bad.value < 0.0 && !deformed.empty())
    f.hint = fmt::format(
        "modes of {} have deformed it beyond what its level can describe: level 2 keeps a mass matrix positive definite, and so does less "
        "deflection",
        deformed);
  return f;
}

}  // namespace cardan
