// Closed loops at the start: levers, scales, rank; a start that is not closed is refused.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/base/units.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loop_pass.hpp"
#include "core/model/components.hpp"
#include "core/model/embed_loops.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

constexpr double kStart = 1e-6;  // residual of a start: typed numbers have a finite number of digits

constexpr double kImplied = 1e-12;  // scaled pivots of rows that others imply, at the most

constexpr double kLeastTyped = 1e-7;  // beyond the rank of the start a scaled pivot below is none
constexpr double kMoreTyped = 100.0;  // elsewhere such a pivot is so much more, at the most

constexpr double kStirs = 1e-2;  // a mode moves ends of loops by so much of a unit of mass, or is taken to

constexpr double kMovedByDigits = 100.0 * kTyped;  // [rad, m] given coordinates by what closes what they leave open by kTyped at the most

constexpr double kFar = 0.1;  // [rad]; of slides, levers: what a mechanism is moved by

constexpr double kNoLever = 1e-12;  // of the way from home, or of what moves all mass: what rounding leaves of a distance that is none

struct Reach {
  double arm = 0.0;   // [m] largest distance of an end from a hinge on the way to it; 0 where it is rounding
  double home = 0.0;  // [m] largest distance of these hinges from home
};
/// `unit`: a length of what moves.
Reach reach_of(const Model& model, const Workspace& ws, const Loop& loop, std::size_t l, const double* q, double unit) {
  Reach reach;
  for (const auto& [path, end] : {std::pair(&loop.from_path, &ws.loops->from[l]), std::pair(&loop.to_path, &ws.loops->to[l])}) {
    Pose<double> X;
    for (const int k : *path) {
      X = X * soa::pose_in_inboard(model, ws, k, q);
      const Vec3<double> arm = end->x - X.p;
      reach.arm = std::max(reach.arm, std::sqrt(dot(arm, arm)));
      reach.home = std::max(reach.home, std::sqrt(dot(X.p, X.p)));
    }
  }
  if (!(reach.arm > kNoLever * std::max(reach.home, unit))) reach.arm = 0.0;
  return reach;
}

/// What is open at the start by more than `limit` of the size of its loop, row by row: of places, else of rates.
struct OpenRows {
  std::vector<std::string> places, rates;  // per loop; empty: closed
  bool any_place = false, any_rate = false;
};
OpenRows open_rows(const Model& model, const LoopPass& pass, const LoopWork& work, const Eigen::VectorXd& v, double limit = kStart) {
  OpenRows out;
  const std::vector<std::uint8_t> turns = turning(model);
  for (const Loop& loop : model.loops.all) {
    std::string places, rates;
    double turn = 1.0, shift = 0.0;  // [rad/s], [m/s] of its rates
    for (const int i : loop.rates) {
      double& most = turns[static_cast<std::size_t>(i)] ? turn : shift;
      most = std::max(most, std::abs(v[i]));
    }
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Force<double>& W = work.W[at];
      const bool couples = loop.closing == Closing::coupling, angle = !couples && dot(W.n, W.n) > dot(W.f, W.f);
      const double size = angle ? 1.0 : loop.lever;
      const double pace = couples ? pass.size_of(loop) * std::max(turn, shift) : angle ? turn : std::max(turn * size, shift);
      const std::string name = name_of_row(loop, i, W);
      const auto add = [&](std::string& text, double value, const char* per) {
        text += fmt::format("{}{} {:.3g}{}{}", text.empty() ? "" : "; ", name, value, unit_of_row(loop, W), per);
      };
      if (!(std::abs(work.c[at]) <= limit * size)) add(places, work.c[at], "");
      const std::optional<double> rate = loop.drive < 0 ? 0.0 : model.spec->loops[static_cast<std::size_t>(loop.spec)].rate;
      if (rate && !(std::abs(work.rate[at] - *rate) <= limit * pace)) add(rates, work.rate[at] - *rate, couples ? " 1/s" : "/s");
    }
    out.any_place = out.any_place || !places.empty(), out.any_rate = out.any_rate || !rates.empty();
    out.places.push_back(std::move(places)), out.rates.push_back(std::move(rates));
  }
  return out;
}

/// `may_move`: what the assembler tried, loop by loop; where that is nothing, what was given is at fault.
void refuse_open_start(const Model& model, const OpenRows& open, const std::vector<std::vector<std::string>>& may_move) {
  if (!open.any_place && !open.any_rate) return;
  DiagnosticSink sink;
  for (std::size_t l = 0; l < model.loops.all.size(); ++l) {
    const auto report = [&](const std::string& expected, const std::string& got, const char* hint) {
      if (!got.empty()) sink.report(Code::open_start, model.spec->locate("loops." + model.loops.all[l].name), expected, got, hint);
    };
    std::string nearest;
    for (const MovedAtStart& m : model.loops.moved)
      if (!m.unit.ends_with("/s") && std::ranges::find(may_move[l], m.name) != may_move[l].end())
        nearest += fmt::format("{}{} {:.6g} {}", nearest.empty() ? ", at " : ", ", m.name, m.found, m.unit);
    if (may_move[l].empty())
      report("initial coordinates that close it", open.places[l],
             "give `initial` of the hinges between its ends the values that bring them together, or none: they are found then");
    else
      report(fmt::format("a place of {} that closes it", fmt::join(may_move[l], ", ")),
             open.places[l].empty() ? "" : open.places[l] + nearest,
             "none nearer was found from the start without passing a singular posture; begin elsewhere, or hold less (assembly: {hold: "
             "[...]})");
    if (open.places[l].empty())
      report("initial rates that keep it closed", open.rates[l],
             "give `initial` of the hinges rates that move both ends alike, or none: they are found then; where other rows should imply "
             "these, places or axes are off by more than 1e-4 of the loop");
  }
  sink.throw_if_any();
}

void check_assembly(const Model& model) {
  DiagnosticSink sink;
  const AssemblySpec& assembly = model.spec->assembly;
  const auto known = [&](const std::string& name, const std::string& key) {
    if (!components_of(model, name).empty()) return;
    sink.report(Code::unknown_name, model.spec->locate("assembly." + key), "a hinge that moves, or a component of one", in_quotes(name),
                did_you_mean(name, component_names(model)));
  };
  for (std::size_t i = 0; assembly.hold && i < assembly.hold->size(); ++i) known((*assembly.hold)[i], fmt::format("hold[{}]", i));
  for (const auto& [name, weight] : assembly.weights) {
    known(name, "weights." + name);
    if (!(weight > 0.0 && std::isfinite(weight)))
      sink.report(Code::out_of_range, model.spec->locate("assembly.weights." + name), "a finite number > 0", fmt::format("{:g}", weight));
  }
  sink.throw_if_any();
}

/// Of components that may move ends of loops against each other what moves them by about the size of a loop: 1 rad, a lever, so much of a
/// mode; 0 of all others. Needs G.
Eigen::VectorXd units_of_motion(const Model& model, const LoopWork& work) {
  const std::vector<std::uint8_t> turns = turning(model);
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(model.nv), by_mode = unit;
  double mass = 0.0;
  for (const UserBody& u : model.user) by_mode.segment(u.etadot, u.n_modes).setOnes(), mass += u.mass;
  for (const Loop& loop : model.loops.all)
    for (const int v : loop.rates) {
      if (model.has_prescribed() && model.prescribed[static_cast<std::size_t>(v)]) continue;
      unit[v] = turns[static_cast<std::size_t>(v)] ? 1.0 : loop.lever;
      if (by_mode[v] == 0.0) continue;
      double moves = kStirs / std::sqrt(mass);
      for (int i = loop.first; i < loop.first + loop.rows; ++i)
        moves = std::max(moves, std::abs(work.G[static_cast<std::size_t>(i * model.nv + v)]) * work.scale[static_cast<std::size_t>(i)]);
      unit[v] /= moves;
    }
  return unit;
}

/// Given coordinates that were moved by what digits may amount to.
bool is_near(const Model& model, const Eigen::VectorXd& given, const Eigen::VectorXd& found) {
  Eigen::VectorXd way(model.nv);
  model.difference(given.data(), found.data(), way.data());
  return way.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMovedByDigits;
}

/// The rank of the start, and what a pivot beyond it is to exceed. Needs matrix().
void find_start_rank(Model& model, LoopPass& pass, const LoopWork& work, const Eigen::VectorXd& q) {
  Loops& loops = model.loops;
  loops.rank = 0, loops.dependent = kTyped;
  pass.find_rank();
  loops.dependent = kLeastTyped;
  if (work.largest > kImplied) {
    const std::optional<double> typed = implied_by_others(model, q);
    loops.dependent = typed ? std::clamp(kMoreTyped * *typed, kLeastTyped, kTyped) : 0.0;
    if (!typed) pass.find_rank();
  }
  loops.rank = work.rank, loops.dependent = std::max(loops.dependent, more_than_dependent(pass.open()));
}

std::vector<double> scaled_rows(const Model& model, const LoopPass& pass, const LoopWork& work) {
  const Loops& loops = model.loops;
  const auto nv = static_cast<std::size_t>(model.nv);
  std::vector<double> rows(static_cast<std::size_t>(loops.rows) * nv);
  for (const Loop& loop : loops.all)
    for (int i = loop.first; i < loop.first + loop.rows; ++i)
      for (std::size_t v = 0; v < nv; ++v) {
        const std::size_t at = static_cast<std::size_t>(i) * nv + v;
        const bool given = model.has_prescribed() && model.prescribed[v];
        rows[at] = given ? 0.0 : work.G[at] * pass.in_metres(loop, i) * loops.column_scale[v] / loop.reference;
      }
  return rows;
}

void take_embedding(Model& model, Embedding embedding) {
  model.loops.embedding = std::make_shared<const Embedding>(std::move(embedding));
  for (const EmbeddingStep& step : model.loops.embedding->steps) {  // P of these is not constant
    const bool wheel = step.kind == EmbeddingStep::Kind::wheel;
    if (!wheel && step.kind != EmbeddingStep::Kind::close) continue;
    const auto k = static_cast<std::size_t>(wheel ? model.bodies[static_cast<std::size_t>(step.body)].parent : step.body);
    if (k > 0 && is_axis(model.bodies[k].kind)) model.axis_bodies[k].leaf = false;
  }
  for (const int k : model.loops.embedding->factored) {
    FlexibleBody& f = model.flexible[static_cast<std::size_t>(model.bodies[static_cast<std::size_t>(k)].flexible)];
    f.by_nodes = false, f.pushed_by_loops = true;
  }
  sweep_embedded(model);
}

/// A description that begins there.
void begin_at(Model& model, const State& start) {
  auto spec = std::make_shared<SystemSpec>(*model.spec);
  for (std::size_t i = 0; i < model.user.size(); ++i) {
    const UserBody& u = model.user[i];
    if (u.nv == 0) continue;
    HingeSpec& hinge = spec->bodies[i].hinge;
    hinge.q.assign(start.q.data() + u.q, start.q.data() + u.q + u.nq);
    hinge.v.assign(start.v.data() + u.v, start.v.data() + u.v + u.nv);
  }
  model.spec = std::move(spec);
}

/// Embedding, where it is not unwanted.
void choose_form(Model& model, const LoopPass& pass, Workspace& ws, const double* q) {
  Loops& loops = model.loops;
  const std::vector<double> rows = scaled_rows(model, pass, *ws.loops);
  Embedding embedding = embed_loops(model, rows, !stand(model, ws, q, true), loops.sets);
  const LoopForm form = model.spec->loop_form;
  if (form == LoopForm::multipliers || form == LoopForm::dae) {
    for (LoopSet& set : loops.sets) set.form = form == LoopForm::dae ? "multipliers of all bodies" : "multipliers", set.why = "asked for";
    return;
  }
  const bool square_root = std::ranges::any_of(model.bodies, &SweepBody::square_root);
  if (square_root || loops.left_open) {  // rows that contradict each other a little stay the same ones over the open tree alone
    for (LoopSet& set : loops.sets)
      set.form = "multipliers", set.why = square_root ? "a hinge is factored in square-root form" : "rows that others imply are open";
    return;
  }
  take_embedding(model, std::move(embedding));
}

}  // namespace

std::vector<std::uint8_t> turning(const Model& model) {
  std::vector<std::uint8_t> out(static_cast<std::size_t>(model.nv));
  for (const UserBody& u : model.user)
    for (int i = 0; i < u.nv; ++i) out[static_cast<std::size_t>(u.v + i)] = u.v_units[static_cast<std::size_t>(i)] == "rad/s";
  return out;
}

bool stand(const Model& model, Workspace& ws, const double* q, bool inertia) {
  make_room_for_loops(model, ws);
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const double* still = ws.loops->zero.data();
  const Inputs in{.q = q, .v = still, .vdot = still, .gravity = false};
  outward(model, S, ws, in, {.velocity = false});
  for (auto run = model.runs.rbegin(); inertia && run != model.runs.rend() && ws.breakdown.body == 0; ++run)
    S.inward(model, ws, in, *run, {.bias = false});
  return ws.breakdown.body == 0;
}

void prepare_loops(Model& model) {
  Loops& loops = model.loops;
  check_assembly(model);
  const auto inertia = [&](const Eigen::VectorXd& q) {
    Loops closed = std::exchange(loops, {});
    Workspace ws(model);
    Eigen::MatrixXd M = mass_matrix(model, ws, q.data());
    loops = std::move(closed);
    return M;
  };
  for (Loop& loop : loops.all) {
    if (!loop.hinge) continue;
    loop.q0.assign(loop.hinge->nq, 0.0);
    if (loop.hinge->zero) loop.hinge->zero(loop.packed.data(), loop.q0.data());
  }
  Workspace ws(model);
  State start = model.initial_state();
  const std::vector<std::uint8_t> turns = turning(model);
  std::vector<std::uint8_t> is_mode(static_cast<std::size_t>(model.nv));
  double mass = 0.0;
  for (const UserBody& u : model.user) std::fill_n(is_mode.begin() + u.etadot, u.n_modes, std::uint8_t{1}), mass += u.mass;
  const double of_all = mass > 0.0 ? 1.0 / std::sqrt(mass) : 1.0;
  /// Levers, scales and coordinates of hinges that close, at a start; then its residuals with them.
  const auto measure = [&](double limit) {
    stand(model, ws, start.q.data(), false);
    const Inputs in{.q = start.q.data(), .v = start.v.data(), .gravity = false};  // a pass refers to it
    LoopPass pass(model, ws, in);
    pass.place();
    const Eigen::VectorXd diagonal = inertia(start.q).diagonal();
    loops.column_scale.assign(diagonal.data(), diagonal.data() + model.nv);
    for (double& x : loops.column_scale) x = x > 0.0 ? 1.0 / std::sqrt(x) : 1.0;
    for (std::size_t l = 0; l < loops.all.size(); ++l) {
      Loop& loop = loops.all[l];
      loop.reference = 0.0;
      const auto refer = [&](int v, double arm) {
        loop.reference = std::max(loop.reference, arm * loops.column_scale[static_cast<std::size_t>(v)]);
      };
      if (loop.closing == Closing::coupling) {
        const std::vector<double>& gradient = ws.loops->gradient[l];
        double steepest = 0.0;
        for (const double slope : gradient) steepest = std::max(steepest, std::abs(slope));
        const bool flat = steepest == 0.0;  // at the start: it is measured as if it had a slope of one
        if (loop.turns()) loop.lever = flat ? 1.0 : steepest;
        for (std::size_t i = 0; i < gradient.size(); ++i) refer(loop.coupling.terms[i].v, flat ? 1.0 : std::abs(gradient[i]));
        continue;
      }
      constexpr double kNone = std::numeric_limits<double>::infinity();
      double mass_scale = kNone, inertia_scale = kNone;  // of the heaviest that slides, and of the largest inertia that turns
      for (const int v : loop.rates)
        if (const auto at = static_cast<std::size_t>(v); !is_mode[at]) {
          double& scale = turns[at] ? inertia_scale : mass_scale;
          scale = std::min(scale, loops.column_scale[at]);
        }
      // What stands on all of its hinges has the length it keeps, or that of the way from home: in orbit, 7000 km, that says nothing of
      // what flies, which is at most as large as its radius of gyration, and nor does what a catch at home leaves of it.
      const double unit = mass_scale < kNone && inertia_scale < kNone ? mass_scale / inertia_scale : 1.0;
      const Reach reach = reach_of(model, ws, loop, l, start.q.data(), unit);
      const double way = reach.home > kStart * unit ? std::min(reach.home, unit) : unit;
      loop.lever = reach.arm > 0.0 ? reach.arm : loop.length > 0.0 ? loop.length : way;
      const bool of_places = loop.closing == Closing::point || loop.closing == Closing::distance;  // turns move its ends by its arms alone
      for (const int v : loop.rates)
        if (const auto at = static_cast<std::size_t>(v); !is_mode[at]) refer(v, !turns[at] ? 1.0 : of_places ? reach.arm : loop.lever);
      if (loop.hinge) loop.q0 = ws.loops->q[l];
    }
    pass.place();  // with the levers
    pass.matrix();
    for (Loop& loop : loops.all) {  // the arm of a mode, in metres for one of its coordinate, is what it moves the ends by
      const bool by_hinges = loop.reference > 0.0;
      for (int i = loop.first; i < loop.first + loop.rows; ++i)
        for (const int v : loop.rates)
          if (const auto at = static_cast<std::size_t>(v); is_mode[at])
            loop.reference = std::max(loop.reference, std::abs(ws.loops->G[static_cast<std::size_t>(i * model.nv + v)]) *
                                                          pass.in_metres(loop, i) * loops.column_scale[at]);
      if (!by_hinges && !(loop.reference > kNoLever * of_all)) loop.reference = of_all;  // modes that move both ends alike
    }
    return open_rows(model, pass, *ws.loops, start.v, limit);
  };
  const State given = start;
  std::vector<std::vector<std::string>> may_move;
  if (const OpenRows open = measure(kStart); open.any_place || open.any_rate) {
    const bool places = open.any_place, by_digits = places && !measure(kTyped).any_place;
    bool given_moves = false;
    assemble_start(model, ws, inertia, places, given_moves, start, may_move);
    if (by_digits && measure(kStart).any_place) {
      const State nearest = std::exchange(start, given);
      measure(kStart);
      given_moves = true;
      if (!assemble_start(model, ws, inertia, places, given_moves, start, may_move) || !is_near(model, given.q, start.q)) start = nearest;
    }
    measure(kStart);
    loops.moved = moved_at_start(model, given, start, given_moves);
    begin_at(model, start);
  }
  const Inputs in{.q = start.q.data(), .v = start.v.data(), .gravity = false};
  LoopPass pass(model, ws, in);
  pass.matrix();
  find_start_rank(model, pass, *ws.loops, start.q);
  if (loops.rank < loops.rows) {
    State closed = start;
    LoopProjection projection(model);
    Workspace there(model);
    loops.left_open = projection.close(closed.q.data(), closed.v.data()) &&
                      (projection.left_open() > 0.0 || loop_rank(model, there, closed.q.data()).largest > kImplied);
  }
  refuse_open_start(model, open_rows(model, pass, *ws.loops, start.v, loops.left_open ? kTyped : kStart), may_move);
  choose_form(model, pass, ws, start.q.data());
}

std::optional<double> implied_by_others(const Model& model, const Eigen::VectorXd& q) {
  Model trial = model;
  Loops& loops = trial.loops;
  Workspace ws(trial);
  loops.rank = 0, loops.dependent = kTyped;
  loops.rank = loop_rank(trial, ws, q.data()).rank;
  LoopProjection projection(trial);
  Eigen::VectorXd at_rest = Eigen::VectorXd::Zero(model.nv), closed = q, there(model.nq);
  if (!projection.close(closed.data(), at_rest.data())) return {};
  double most = loop_rank(trial, ws, closed.data()).largest;
  const Eigen::VectorXd unit = units_of_motion(trial, *ws.loops);
  for (const int which : {0, 1}) {
    Eigen::VectorXd v = some_rates(which, model.nv).cwiseProduct(unit);
    if (!projection.close(closed.data(), v.data())) return {};
    double fastest = 0.0;
    for (int i = 0; i < model.nv; ++i)
      if (unit[i] > 0.0) fastest = std::max(fastest, std::abs(v[i]) / unit[i]);
    if (!(fastest > kImplied)) break;  // nothing is left free
    v *= kFar / fastest;
    model.retract(closed.data(), v.data(), there.data());
    if (!projection.close(there.data(), at_rest.data())) return {};
    const LoopRank rank = loop_rank(trial, ws, there.data());
    if (rank.rank != loops.rank) return {};
    most = std::max(most, rank.largest);
  }
  return most;
}

std::shared_ptr<const Model> embedded_by(const Model& model, const std::vector<std::uint8_t>& by_rates) {
  auto out = std::make_shared<Model>(model);
  sweep_open_tree(*out);
  out->loops.embedding = nullptr;
  Workspace ws(*out);
  const State start = out->initial_state();
  stand(*out, ws, start.q.data(), false);
  const Inputs in{.q = start.q.data(), .v = start.v.data(), .gravity = false};
  LoopPass pass(*out, ws, in);
  pass.place();
  pass.matrix();
  take_embedding(*out, embed_loops(*out, scaled_rows(*out, pass, *ws.loops), by_rates));
  return out;
}

}  // namespace cardan
