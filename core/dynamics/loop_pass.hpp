#pragma once
// One evaluation of closed loops, as its parts share it: rows (loop_rows.cpp), rank (loop_rank.cpp), multipliers over the open tree
// (loop_multipliers.cpp); what they write is LoopWork.
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "core/dynamics/loop_place.hpp"
#include "core/dynamics/loops.hpp"
#include "core/dynamics/part.hpp"
#include "core/model/embedding.hpp"
#include "core/model/loops.hpp"
#include "core/soa/embedding_work.hpp"

namespace cardan {

struct AbsoluteWork;  // core/dynamics/absolute.hpp

/// Scratch of the loops of one model, in a workspace; made in its first call.
struct LoopWork {
  using End = LoopEndMotion<double>;
  using Relative = soa::RelativePlace;
  LoopWork(const Model& model, Workspace& ws);

  std::vector<End> from, to;  // per loop
  std::vector<Relative> relative;
  std::vector<std::vector<double>> q, v;      // of hinges that close, of each loop
  std::vector<const double*> near_q;          // where these q are looked for; null: near Loop::q0
  std::vector<std::vector<double>> gradient;  // of couplings: per term, of each loop
  // Per row:
  std::vector<Force<double>> W;       // what a multiplier of 1 does to the end `to`, axes of the node `from`
  std::vector<Force<double>> near_W;  // near which the W of hinges that close are chosen; empty: near coordinate directions
  std::vector<double> c, rate, extra, open, acceleration, rhs, lambda, step, scale;
  // rows x nv, row by row: G, and M^-1 G* of the rows that count.
  std::vector<double> G, U;
  // Rank: rows x columns scaled, and how rows and columns were exchanged.
  std::vector<int> columns, row_at, column_at;  // columns: rates that are not given; those that a device holds are now and then
  std::vector<int> may_be_held;                 // components that devices hold, of hinges that move the ends of loops against each other
  std::vector<int> largest_of;                  // column per row, of those that are left
  std::vector<int> others;                      // that imply a row
  std::vector<double> B, L, Lambda, N, NN, y;
  int rank = 0;
  double smallest = 0.0, largest = 0.0, dependent = 0.0;  // pivots that were kept, that were not; what a pivot was to exceed
  // What acts on the bodies before the inward sweeps; on bodies but rotors from where it stands in the workspace to z.
  std::vector<std::pair<const Force<double>*, Force<double>*>> kept_z;
  std::vector<const double*> loads_on_rotors;
  std::vector<Motion<double>> gamma;
  std::vector<Force<double>> z;
  std::vector<double> z_modes, rotor_loads;
  std::vector<NodeWrench> wrenches, one;
  std::vector<double> tau, tau_of_row, response, zero;
  std::vector<Run> near;  // bodies that loops move and all inboard of them
  bool coupled = false;
  std::unique_ptr<AbsoluteWork, void (*)(AbsoluteWork*)> absolute{nullptr, nullptr};  // of the op `absolute`
  // Closed inside of the sweeps (loop_embedding.cpp):
  std::unique_ptr<soa::EmbeddingWork> embedding;
  bool unsettled = false;  // multipliers and what the workspace has of the closed system are those of another evaluation
  std::vector<Force<double>> through;
  std::vector<double> vdot, left, pushed, of_coordinates, few;
};

class LoopPass {
 public:
  /// The workspace has room for loops (make_room_for_loops).
  LoopPass(const Model& model, Workspace& ws, const Inputs& in)
      : m_(model), loops_(model.loops), ws_(ws), k_(*ws.loops), in_(in), S_(soa::sweeps<double>()) {}
  LoopPass(const Model&, Workspace&, Inputs&&) = delete;  // it refers to its inputs

  /// Poses and rates of the ends relative to each other, rows, c and G v. Needs outward.
  void place();
  /// W, c and c'' - W* [w'; u'] of a loop that a hinge type closes.
  void close_by_hinge(int loop, const soa::RelativePlace& place, Force<double>* W, double* c, double* extra);
  /// c'' of all rows as the workspace and vdot have it, v' included.
  void accelerations(const double* vdot, double* out) const;
  /// G of the v' that the sweeps have just given to a system at rest.
  void responses(const double* vdot, double* out) const;

  /// G, row by row: what a multiplier of 1 is as hinge forces.
  void matrix();
  /// Independent rows by complete pivoting on scaled G: rates in the root of their energy, rows in metres.
  void find_rank();
  /// What places are open by most, relative to the size of their loops. Needs find_rank().
  double open() const {
    double most = 0.0;
    for (const Loop& loop : loops_.all)
      for (int i = loop.first; i < loop.first + loop.rows && loop.turns(); ++i)
        most = std::max(most, std::abs(k_.c[at(i)]) * k_.scale[at(i)] / loop.lever);
    return most;
  }

  /// M^-1 G* and G M^-1 G* of the independent rows, factored. Needs P, D, G of the sweeps; `runs`: as far as U is wanted. false: a row
  /// without compliance.
  bool compliance(const std::vector<Run>& runs);
  /// Multipliers of the independent rows for G v' = rhs (all rows), added to lambda.
  void solve(const double* rhs, double* lambda);
  /// Of all multipliers that push alike those of smallest norm: less what lies in the left null space of G.
  void share();
  /// Takes from x, one number a row, what n vectors of that null space hold of it: LoopWork::N, one a line.
  void take_left_null_space(int n, double* x);
  /// Takes from what rows are to do that in which they contradict each other, least squares of rows in metres: where others imply a row
  /// but for what numbers were typed with, which of them count says no more than that.
  void reconcile(double* x);
  /// The multipliers as wrenches on nodes and as hinge forces of couplings, beside those of actuators.
  void push();
  /// z and gamma_b of all bodies as they were kept.
  void restore();
  /// The inward and outward sweeps once more, from what was kept, with the loops pushing.
  void move(double* vdot);

  /// The largest slope of a coupling, of another loop its lever: what a row of one, in metres, is compared with.
  double size_of(const Loop& loop) const {
    double size = loop.lever;
    for (const double slope : k_.gradient[at(&loop - loops_.all.data())]) size = std::max(size, std::abs(slope));
    return size;
  }
  /// How far its ends are from home, or its coordinates from zero, in what its rows are measured in: they are rounded to so much.
  double reach_of(const Loop& loop) const {
    const std::size_t l = at(&loop - loops_.all.data());
    if (loop.closing != Closing::coupling) return std::sqrt(std::max(dot(k_.from[l].x, k_.from[l].x), dot(k_.to[l].x, k_.to[l].x)));
    double reach = 0.0;
    for (std::size_t i = 0; i < k_.gradient[l].size(); ++i)
      reach = std::max(reach, std::abs(k_.gradient[l][i] * in_.q[loop.coupling.terms[i].q]));
    return reach;
  }
  /// Factor that takes a row to metres.
  double in_metres(const Loop& loop, int row) const {
    if (loop.closing == Closing::coupling) return 1.0;
    const Force<double>& W = k_.W[at(row)];
    return 1.0 / std::sqrt(dot(W.n, W.n) / (loop.lever * loop.lever) + dot(W.f, W.f));
  }
  /// f on the end `to`, its opposite on the end `from`: wrenches on nodes, node axes. Needs place().
  std::span<const NodeWrench> wrenches_of(const Loop& loop, const Force<double>& f);
  const Loop& loop_of(int row) const {
    std::size_t l = 0;
    while (row >= loops_.all[l].first + loops_.all[l].rows) ++l;
    return loops_.all[l];
  }

 private:
  /// Of G, into LoopWork::N. How many vectors it has. Needs find_rank().
  int find_left_null_space();

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static std::size_t at(std::size_t i) { return i; }
  static std::size_t at(std::ptrdiff_t i) { return static_cast<std::size_t>(i); }

  Inputs at_rest() const { return {.q = in_.q, .v = k_.zero.data(), .vdot = k_.zero.data(), .gravity = false}; }

  /// Factor of a row of G in LoopWork::B.
  double weight(int row) const { return k_.scale[at(row)] / loop_of(row).reference; }
  /// What makes the diagonal of G M^-1 G* one.
  double unit(int p) const { return k_.L[at(p)]; }
  bool factor_compliance();

  void couple(const Loop& loop, std::size_t l);
  void drive(const Loop& loop);
  /// What a coupling with this multiplier pushes with.
  void add_gradient(const Loop& loop, double multiplier, double* tau) const;
  double coupled(const Loop& loop, std::size_t l, const double* v) const;
  /// G v' of couplings; then `join(loop, l)`, which does it for what joins places.
  template <class Join>
  void each_loop(const double* vdot, double* out, const Join& join) const {
    for (std::size_t l = 0; l < loops_.all.size(); ++l) {
      const Loop& loop = loops_.all[l];
      if (loop.closing == Closing::coupling) out[loop.first] = coupled(loop, l, vdot);
      join(loop, l);
    }
  }
  void close(const Loop& loop, std::size_t l);
  void close_by_hinge(const Loop& loop, std::size_t l, Force<double>* W, double* c, double* extra);

  /// Node axes.
  Motion<double> response(const LoopEnd& end, const LoopWork::End& e, const double* vdot) const;

  const Model& m_;
  const Loops& loops_;
  Workspace& ws_;
  LoopWork& k_;
  const Inputs& in_;
  const soa::Sweeps<double>& S_;
};

/// A device holds a component of a hinge that loops have taken up: they are closed over the open tree, which leaves such components out.
bool holds_loops(const Model& model, const LoopWork& work);

/// A scaled pivot below is none: of redundant rows they are 1e-16, of others above 1e-3 but near singular postures.
inline constexpr double kDependent = 1e-10;
/// The same of rows beyond the rank of the start, at a state that is open by so much of the size of a loop: what agrees on closed loops
/// differs on open ones by about as much; but not more than 1e-4: rows of loops that are far open are still rows.
inline double more_than_dependent(double open) { return std::max(kDependent, std::min(10.0 * open, 1e-4)); }

/// Observers read of the workspace what the open tree does with the loops pushing (push()), from what was kept. `vdot`: of the
/// closed system.
void push_open_tree(const Model& model, Workspace& ws, const Inputs& in, LoopPass& pass, const double* vdot);
/// Where each component of v is an angular velocity.
std::vector<std::uint8_t> turning(const Model& model);
/// The start that is nearest in the metric of the mass matrix (weighted) and closes the loops: hinges that may move do, on the way from the
/// given one without passing a singular posture; and the rates nearest to the given ones. `places`: not only the rates are open.
/// `may_move` names the coordinates, loop by loop. False: not closed; loops that share no such coordinate with one that cannot be closed
/// are closed all the same, the others as near as they got. Rows that others imply but for what numbers were typed with stay open by as
/// much (kTyped). `given_moves`: coordinates that were given may move too.
bool assemble_start(Model& model, Workspace& ws, const std::function<Eigen::MatrixXd(const Eigen::VectorXd&)>& inertia, bool places,
                    bool given_moves, State& start, std::vector<std::vector<std::string>>& may_move);
/// What it has changed.
std::vector<MovedAtStart> moved_at_start(const Model& model, const State& given, const State& start, bool given_moves);
/// Whether rows with scaled pivots below kTyped are implied by the others but for what numbers were typed with: moved along what the others
/// leave free, far beyond that, and closed by the others alone, loops are open by no more, and the pivots are as small. That tells them
/// from rows near a singular posture, and from those on what is heavy beside what is light. The largest of these pivots on the way, at most
/// kTyped; nothing where they are not implied. Embeddings are not made yet.
std::optional<double> implied_by_others(const Model& model, const Eigen::VectorXd& q);
void make_room_for_loops(const Model& model, Workspace& ws);
/// gamma_b of all bodies, which only an outward sweep changes: what keep_loads leaves out where loops are closed inside of the sweeps.
void keep_gamma(const Model& model, Workspace& ws);
/// Poses at q; P, D and G where `inertia`. false: a direction without inertia.
bool stand(const Model& model, Workspace& ws, const double* q, bool inertia);
/// Closed inside of the sweeps: the least motion M^-1 G* mu of which G is -rates. Needs stand(), P of each body by itself; false: not by
/// the program of the start.
bool embedded_response(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives, const std::vector<double>& rates,
                       double* out);
/// NumericsError N0601 where motions v, free to first order, cannot all go on: rows imply each other here alone, and to second order
/// motions contradict each other, each of which by itself may go on. v: nv, keeps the loops closed.
void require_regular_posture(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives, const Eigen::VectorXd& v);
/// Rates of independent components by which to ask it: two of these, none zero and none alike.
Eigen::VectorXd some_rates(int which, Eigen::Index n);
/// W: of the row.
std::string name_of_row(const Loop& loop, int row, const Force<double>& W);
/// " m", " rad"; of couplings "".
const char* unit_of_row(const Loop& loop, const Force<double>& W);

}  // namespace cardan
