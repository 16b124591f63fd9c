// Loops closed inside of the sweeps: the op `embedding`, and what is made of it where somebody looks (docs/mathematics/loops.md, 4).
#include <algorithm>
#include <cmath>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loop_pass.hpp"

namespace cardan {
namespace {

constexpr double kBroken = 1e-10;  // what rows left out since the start may lack, relative to the rates of their loops

/// Inward, outward, and multipliers.
bool over_the_open_tree(const Model& model, Workspace& ws, const Inputs& in, double* vdot) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) {
    S.inward(model, ws, in, *run, {});
    if (ws.breakdown.body != 0) return false;
  }
  for (const Run& run : model.runs) S.acceleration(model, ws, in, run, vdot);
  return close_loops(model, ws, in, vdot);
}

int embed(const Model& model, Workspace& ws, const Inputs& in, const double* given, double* vdot) {
  LoopPass pass(model, ws, in);
  const soa::RowsOfHinges hinges{[](void* context, int loop, const soa::RelativePlace& place, Force<double>* W, double* c, double* extra) {
                                   static_cast<LoopPass*>(context)->close_by_hinge(loop, place, W, c, extra);
                                 },
                                 &pass};
  return soa::instruction_set().embedded(model, *model.loops.embedding, soa::sweeps<double>(), ws, *ws.loops->embedding, in, hinges, given,
                                         vdot);
}

/// v' keeps the rows that were left out at the start. It does not where they have become independent, or contradict the others.
bool keeps_rows_left_out(const Model& model, Workspace& ws, const Inputs& in, const double* vdot) {
  LoopWork& k = *ws.loops;
  LoopPass pass(model, ws, in);
  pass.place();
  pass.accelerations(vdot, k.acceleration.data());
  double open = 0.0, size = 0.0, most = 0.0;
  for (const Loop& loop : model.loops.all) {
    for (const int v : loop.rates) size = std::max(size, std::abs(vdot[v]) / model.loops.column_scale[static_cast<std::size_t>(v)]);
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const double metres = pass.in_metres(loop, i);
      if (loop.turns()) open = std::max(open, std::abs(k.c[at]) * metres / loop.lever);
      const double missing = std::abs(k.acceleration[at]) * metres / loop.reference;
      if (!(missing <= most)) most = missing;
    }
  }
  return most <= (kBroken + 1e3 * open) * size;
}

/// A x = b by rows [A b], partial pivoting; x in place of b.
void eliminate(double* A, int r) {
  const int stride = r + 1;
  for (int p = 0; p < r; ++p) {
    int best = p;
    for (int i = p + 1; i < r; ++i)
      if (std::abs(A[i * stride + p]) > std::abs(A[best * stride + p])) best = i;
    if (best != p) std::swap_ranges(A + p * stride, A + (p + 1) * stride, A + best * stride);
    for (int i = p + 1; i < r; ++i) {
      const double factor = A[i * stride + p] / A[p * stride + p];
      for (int j = p; j <= r; ++j) A[i * stride + j] -= factor * A[p * stride + j];
    }
  }
  for (int p = r - 1; p >= 0; --p) {
    double x = A[p * stride + r];
    for (int j = p + 1; j < r; ++j) x -= A[p * stride + j] * A[j * stride + r];
    A[p * stride + r] = x / A[p * stride + p];
  }
}

/// Multipliers after an evaluation: G* lambda = H* f - tau, loop by loop, the last one that was closed first: on the rates that it took up
/// the others that push are those closed after it.
class EmbeddedMultipliers {
 public:
  EmbeddedMultipliers(const Model& model, Workspace& ws, const Inputs& in)
      : m_(model), e_(*model.loops.embedding), ws_(ws), k_(*ws.loops), n_(*k_.embedding), in_(in) {}

  bool find(LoopPass& pass) {
    what_is_left();
    for (const Gear& gear : e_.gears) k_.lambda[at(gear.row)] = gear.per_slope * left_on_wheel(gear.wheel);
    for (const Transmission& t : e_.transmissions) push_wheels(t);
    std::ranges::fill(k_.pushed, 0.0);
    for (std::size_t l = 0; l < e_.loops.size(); ++l) gather(e_.loops[l]);
    for (std::size_t l = e_.loops.size(); l-- > 0;) solve(e_.loops[l], k_.lambda.data());
    if (e_.chosen) {
      pass.matrix();
      pass.find_rank();
      pass.share();
      return true;
    }
    // The left null space of G: one column per row that is left out.
    int n = 0;
    std::ranges::fill(k_.left, 0.0);
    std::ranges::fill(k_.of_coordinates, 0.0);
    for (std::size_t l = 0; l < e_.loops.size(); ++l) {
      const EmbeddedLoop& c = e_.loops[l];
      for (int i = c.rank; i < c.rows; ++i) {
        double* N = k_.N.data() + at(n++) * k_.lambda.size();
        std::fill_n(N, k_.lambda.size(), 0.0);
        std::ranges::fill(k_.pushed, 0.0);
        N[c.first + n_.row_at[at(c.row + i)]] = 1.0;
        push(c, N);
        if (c.by_rates)
          for (std::size_t before = l + 1; before-- > 0;) solve(e_.loops[before], N);
        else
          solve_rows_of_multipliers(c, N);
      }
    }
    if (n > 0) pass.take_left_null_space(n, k_.lambda.data());
    return true;
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  double left_on_wheel(int k) const {
    const AxisBody& wheel = m_.axis_bodies[at(k)];
    const soa::Core<double>& carrier = ws_.core(wheel.parent);
    const Vec3<double> u{wheel.u[0], wheel.u[1], wheel.u[2]};
    const double moment = ws_.axis(k).load + (in_.tau ? in_.tau[wheel.v] : 0.0);
    return wheel.J_axial * (dot(u, carrier.gamma.w + carrier.delta.w) + k_.vdot[at(wheel.v)]) - moment;
  }

  /// What wheels of a transmission lack is what its multipliers push on them.
  void push_wheels(const Transmission& t) {
    const std::size_t n = t.wheels.size();
    const double* inverse = n_.ratios.data() + at(t.numbers) + n * (t.way.size() + 1);
    for (const Transmission::Row& row : t.rows) k_.lambda[at(row.row)] = 0.0;
    for (std::size_t w = 0; w < n; ++w) {
      const TurningWheel& wheel = *std::ranges::find(e_.wheels, t.wheels[w], &TurningWheel::body);
      double left = 0.0;
      if (wheel.on_ground) {
        const Vec3<double>& z = ws_.z(wheel.body).n;
        left = (wheel.on_ground == 1   ? z.x
                : wheel.on_ground == 2 ? z.y
                                       : z.z) +
               wheel.J_axial * k_.vdot[at(wheel.v)] - (in_.tau ? in_.tau[wheel.v] : 0.0);
      } else {
        left = left_on_wheel(wheel.body);
      }
      for (std::size_t i = 0; i < n; ++i) k_.lambda[at(t.rows[i].row)] += inverse[w * n + i] * left;
    }
  }

  /// H* f - tau on the rates that loops have taken up, f = P delta + z + Q x through their hinges: what their multipliers push.
  void what_is_left() {
    std::ranges::fill(k_.left, 0.0);
    std::ranges::fill(k_.through, Force<double>{});
    for (const EmbeddingStep& step : e_.steps) {
      const SweepBody& b = m_.bodies[at(step.body)];
      if (step.kind == EmbeddingStep::Kind::wheel) k_.left[at(b.v)] = left_on_wheel(step.body);
      for (const EmbeddingStep::BranchBody& one : step.branch) left_on_item(one.body, step, one.body != step.body);
      if (step.kind == EmbeddingStep::Kind::item) left_on_item(step.body, step, step.to_carried);
    }
  }
  void left_on_item(int body, const EmbeddingStep& step, bool passes) {
    const SweepBody& b = m_.bodies[at(body)];
    const soa::Core<double>& core = ws_.core(body);
    Force<double> f = core.P * core.delta + ws_.z(body) + k_.through[at(body)];
    for (const PendingFlow& flow : step.flows)
      for (int i = 0; flow.own >= 0 && i < e_.loops[at(flow.loop)].n; ++i)
        f += n_.x[at(e_.loops[at(flow.loop)].x + i)] * n_.Q[at(flow.own + i)];
    for (int j = 0; j < b.nv; ++j) k_.left[at(b.v + j)] = dot(soa::hinge_column(m_, ws_, body, j), f) - (in_.tau ? in_.tau[b.v + j] : 0.0);
    if (passes) k_.through[at(b.parent)] += to_inboard(soa::pose_in_inboard(m_, ws_, body, in_.q), f);
  }

  /// left on the coordinates that a loop keeps.
  void gather(const EmbeddedLoop& c) {
    if (!c.by_rates) return;
    double* out = k_.of_coordinates.data() + c.x;
    std::fill_n(out, c.n, 0.0);
    const double* T = n_.numbers.data() + c.T;
    const auto add = [&](int input, double force) {
      for (int i = 0; i < c.keep; ++i) out[i] += force * T[input * c.width + i];
    };
    for (const EmbeddedLoop::Column& x : c.columns)
      if (x.input >= 0) add(x.input, x.scale * k_.left[at(x.v)]);
    for (const EmbeddedLoop::Taken& t : c.taken)
      for (int i = 0; i < t.n; ++i) add(t.input + i, k_.of_coordinates[at(e_.loops[at(t.by)].x + i)]);
  }

  /// What is left on an input beside the loops that were solved.
  void inputs_of(const EmbeddedLoop& c, double* r) const {
    for (const EmbeddedLoop::Column& x : c.columns)
      if (x.input >= 0) r[x.input] = x.scale * (k_.left[at(x.v)] - k_.pushed[at(x.v)]);
    for (const EmbeddedLoop::Taken& t : c.taken) {
      const EmbeddedLoop& other = e_.loops[at(t.by)];
      for (int i = 0; i < t.n; ++i) r[t.input + i] = k_.of_coordinates[at(other.x + i)];
      const double* E = n_.numbers.data() + other.E;
      for (std::size_t j = 0; j < other.columns.size(); ++j, E += other.width)
        for (int i = 0; i < t.n; ++i) r[t.input + i] -= E[i] * k_.pushed[at(other.columns[j].v)];
    }
  }

  /// Entry of G on an input, scaled.
  double entry(const EmbeddedLoop& c, int row, int input) const {
    const double* G = n_.numbers.data() + c.G + row * c.own_columns;
    double sum = 0.0;
    for (int j = 0; j < c.own_columns; ++j) {
      const EmbeddedLoop::Column& x = c.columns[at(j)];
      if (x.input == input) return x.scale * G[j];
      if (x.input >= 0 || x.given) continue;
      const EmbeddedLoop& other = e_.loops[at(x.by)];
      if (input >= other.consumer_input && input < other.consumer_input + other.keep)
        sum += G[j] * n_.numbers[at(other.E + x.at * other.width + input - other.consumer_input)];
    }
    return sum;
  }

  /// Multipliers of its independent rows, from the pivots; added to what `lambda` has of its other rows.
  void solve(const EmbeddedLoop& c, double* lambda) {
    if (!c.by_rates) {
      if (lambda == k_.lambda.data())
        for (int p = 0; p < c.n; ++p) lambda[c.first + n_.row_at[at(c.row + p)]] = n_.x[at(c.x + p)];
      return;
    }
    const int r = c.rank, stride = r + 1;
    double *A = k_.few.data(), *inputs = A + r * stride;
    inputs_of(c, inputs);
    const int *row_at = n_.row_at.data() + c.row, *column_at = n_.column_at.data() + c.pivot;
    for (int i = 0; i < r; ++i) {
      for (int j = 0; j < r; ++j) A[i * stride + j] = entry(c, row_at[j], column_at[i]);
      A[i * stride + r] = inputs[column_at[i]];
    }
    eliminate(A, r);
    for (int p = 0; p < r; ++p) {
      const int row = row_at[p];
      lambda[c.first + row] += A[p * stride + r];
      push(c, row, A[p * stride + r]);
    }
  }

  /// By multipliers: the rows that count, so that together with those left out they push nothing. Pivots of G itself.
  void solve_rows_of_multipliers(const EmbeddedLoop& c, double* N) {
    const int r = c.rank, stride = r + 1;
    double* A = k_.few.data();
    const double* G = n_.numbers.data() + c.G;
    const int *row_at = n_.row_at.data() + c.row, *column_at = n_.column_at.data() + c.pivot;
    for (int i = 0; i < r; ++i) {
      const EmbeddedLoop::Column& x = c.columns[at(column_at[i])];
      for (int j = 0; j < r; ++j) A[i * stride + j] = x.scale * G[row_at[j] * c.own_columns + column_at[i]];
      A[i * stride + r] = -x.scale * k_.pushed[at(x.v)];
    }
    eliminate(A, r);
    for (int p = 0; p < r; ++p) {
      N[c.first + row_at[p]] = A[p * stride + r];
    }
  }

  void push(const EmbeddedLoop& c, int row, double multiplier) {
    const double* G = n_.numbers.data() + c.G + row * c.own_columns;
    for (int j = 0; j < c.own_columns; ++j) k_.pushed[at(c.columns[at(j)].v)] += multiplier * G[j];
  }
  void push(const EmbeddedLoop& c, const double* lambda) {
    for (int i = 0; i < c.rows; ++i)
      if (lambda[c.first + i] != 0.0) push(c, i, lambda[c.first + i]);
  }

  const Model& m_;
  const Embedding& e_;
  Workspace& ws_;
  LoopWork& k_;
  soa::EmbeddingWork& n_;
  const Inputs& in_;
};

}  // namespace

bool run_embedding(const Model& model, Workspace& ws, const Inputs& in, double* vdot) {
  if (holds_loops(model, *ws.loops)) {
    ws.loops->unsettled = false;
    keep_gamma(model, ws);
    return over_the_open_tree(model, ws, in, vdot);
  }
  int result = embed(model, ws, in, nullptr, vdot);
  const bool closed = result == 0 && (!model.loops.embedding->chosen || keeps_rows_left_out(model, ws, in, vdot));
  if (!closed) keep_gamma(model, ws);
  if ((result == 0 && !closed) || (result == 2 && ws.breakdown.row >= 0)) {  // what the sweeps began with, once more
    const soa::Sweeps<double>& S = soa::sweeps<double>();
    S.ground(model, ws, in);
    for (const Run& run : model.runs) S.outward(model, ws, in, run, {.vdot = run.prescribed});
    LoopPass(model, ws, in).restore();
    result = 1;
  }
  ws.loops->unsettled = result == 0;
  if (result == 0) std::copy_n(vdot, model.nv, ws.loops->vdot.data());
  return result == 1 ? over_the_open_tree(model, ws, in, vdot) : result == 0;
}

namespace {

/// At rest, G v' = work.rhs and no force but tau.
bool respond(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives, const double* tau, double* out) {
  LoopWork& work = *ws.loops;
  if (holds_loops(model, work)) return false;
  soa::sweeps<double>().at_rest(model, ws);
  const Inputs at_rest{.q = q, .v = work.zero.data(), .tau = tau, .vdot = work.zero.data(), .gravity = false, .drives = drives};
  const int result = embed(model, ws, at_rest, work.rhs.data(), out);
  if (result == 0) return true;
  ws.breakdown = {};
  return false;
}

}  // namespace

bool embedded_response(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives, const std::vector<double>& rates,
                       double* out) {
  for (std::size_t i = 0; i < rates.size(); ++i) ws.loops->rhs[i] = -rates[i];
  return respond(model, ws, q, drives, nullptr, out);
}

bool closed_response(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives, const double* tau, double* vdot) {
  if (!model.loops.embedding || !stand(model, ws, q, false)) return false;
  std::ranges::fill(ws.loops->rhs, 0.0);
  return respond(model, ws, q, drives, tau, vdot);
}

namespace {

/// The same where a direction of the open tree has no inertia and moves as loops alone have it: with v' the forces are known.
void push_known_motion(const Model& model, Workspace& ws, Inputs in, const double* vdot) {
  if (!model.flexible.empty()) throw NumericsError(describe_breakdown(model, ws.breakdown, 0.0));
  in.vdot = vdot;
  inverse_dynamics_of_tree(model, ws, in, ws.loops->response.data());
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) ws.core(k).delta = {};  // all of it is in gamma, and the force in z
}

}  // namespace

void push_open_tree(const Model& model, Workspace& ws, const Inputs& in, LoopPass& pass, const double* vdot) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  pass.push();
  Inputs pushed = in;
  if (ws.loops->coupled) pushed.tau = ws.loops->tau.data();
  pushed.wrenches = ws.loops->wrenches;
  S.ground(model, ws, in);
  for (const Run& run : model.runs) S.outward(model, ws, in, run, {.vdot = run.prescribed});  // P of each body by itself
  pass.restore();
  S.node_wrenches(model, ws, pushed);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.inward(model, ws, pushed, *run, {});
  if (ws.breakdown.body != 0) return push_known_motion(model, ws, pushed, vdot);
  for (const Run& run : model.runs) S.acceleration(model, ws, pushed, run, ws.loops->response.data());
}

void settle_loops(const Model& model, Workspace& ws, const Inputs& in) {
  if (!ws.loops || !ws.loops->unsettled) return;
  ws.loops->unsettled = false;
  keep_gamma(model, ws);  // rows of G are found with bodies at rest
  LoopPass pass(model, ws, in);
  pass.place();
  std::ranges::fill(ws.loops->lambda, 0.0);
  if (!EmbeddedMultipliers(model, ws, in).find(pass)) return;
  push_open_tree(model, ws, in, pass, ws.loops->vdot.data());
}

}  // namespace cardan
