#pragma once
// The program that closes loops inside of the sweeps (docs/mathematics/loops.md, 4): which hinge rates a loop takes up, what stays pending
// where, in which order. Plain numbers, written once; the sweeps read it.
#include <cstdint>
#include <string>
#include <vector>

#include "core/model/coupling.hpp"
#include "core/model/gears.hpp"
#include "core/model/loop_form.hpp"
#include "core/spatial/pose.hpp"

namespace cardan {

struct Model;

/// Numbers of a row that is read by whole fours.
constexpr int padded(int n) { return (n + 3) / 4 * 4; }

/// Coordinates that a loop adds to the sweeps: those that its rates leave free, or its multipliers. They are pending from the bodies that
/// move with them, or are pushed by them, to its home.
struct EmbeddedLoop {
  /// A body between home and an end.
  struct PathBody {
    int body = 0;
    int inboard = -1;       // index of the one inboard of it, -1: home
    int state = 0;          // index into EmbeddingWork::path
    bool seen = false;      // a loop before, of the same home, has found it
    int column = 0, n = 0;  // of its hinge
    double sign = 1.0;      // of the end: `to` +1, `from` -1
    int motion = -1;        // where its motion per coordinate stands: column of EmbeddingWork::U; -1: it is not wanted
    int of_inboard = -1;    // the same of the body inboard of it; -1: none, that one stands still
    int modes = -1;         // column of its first mode; -1: none of them moves an end
    bool shifts = false;    // a slide with the axes of the inboard body
  };
  /// A hinge rate of the loop, or one that later loops have and that is expressed anew.
  struct Column {
    int v = 0;
    int input = -1;        // taken up here; -1: it was before
    int by = -1, at = -1;  // ... by this loop, and there this column: what it is in the coordinates of that
    int term = -1;         // of a coupling; -1: it does not have this rate
    double scale = 1.0;    // 1 / sqrt(inertia) at the start
    bool given = false;    // its motion is: no coordinate has it
    int as = -1;           // of one before: this input here, where what later loops have are coordinates (EmbeddingWork::named)
  };
  /// Coordinates of another loop that this one has rates in.
  struct Taken {
    int by = -1, input = 0, n = 0;
  };
  int loop = 0;  // index into Loops::all
  Closing closing = Closing::point;
  int first = 0;                                      // of all rows
  Pose<double> from, to;                              // nodes in their bodies, or in the world
  int from_node = -1, to_node = -1;                   // index into SweepModel::nodes of one that deforms with its body
  double length = 0.0, lever = 1.0, reference = 1.0;  // as in Loop
  bool turns = false;                                 // the hinge that closes it does so about one axis and nothing else
  Vec3<double> axis;                                  // ... in its frames
  Coupling coupling;
  int drive = -1;
  bool by_rates = true;  // false: by multipliers
  int home = 0;
  bool constant = false;  // a linear coupling by rates, as those whose coordinates it takes up: T and E are the same in each evaluation
  int rows = 0, rank = 0;
  int n = 0;          // coordinates
  int width = 0;      // numbers in a row of T, E and A: one for each coordinate, one without them, zeros up to whole fours
  int keep = 0;       // the first of them, which later loops need
  int consumer = -1;  // who takes those up (index into Embedding::loops)
  int consumer_input = 0;
  int inputs = 0, own_columns = 0;
  int own = 0;          // the first inputs: rates that this loop takes up and that no later one has
  int needed = 0;       // the next ones: those that later loops have
  bool by_own = false;  // these alone may be pivots: all other inputs are coordinates then, as they are
  std::vector<PathBody> path;
  int from_at = -1, to_at = -1;  // index into path; -1: home
  int home_modes = -1;           // column of the first mode of home; -1: none of them moves an end against the other
  bool after_modes = false;      // closed at home where its modes are eliminated already: they are on the way
  bool deforms = false;          // some mode is a column
  bool chosen = false;           // by multipliers: loops closed before imply rows of it, and which count was chosen at the start
  std::vector<int> kept;         // these
  bool implied = false;          // by rates: rows of some loop are implied by other loops, and may count in place of weak ones
  std::vector<Column> columns;   // own ones first
  std::vector<Taken> taken;
  // Where its numbers begin:
  int G = 0, B = 0, T = 0, E = 0, A = 0, x = 0, row = 0, pivot = 0, gradient = 0;
};

/// Part of A between the coordinates of two loops: entry (i, j) at `at` + i `down` + j `across`.
struct CoordinateBlock {
  int at = -1, down = 0, across = 0;
};

/// Coordinates on their way through a body.
struct PendingFlow {
  int loop = 0;                       // index into Embedding::loops
  int own = -1;                       // column of EmbeddingWork::Q: on the body
  int carried = -1;                   // ... passing
  int to = -1;                        // where it goes; -1: ground
  int own_modes = -1, to_modes = -1;  // the same of EmbeddingWork::modal: on the modes of the body, of the inboard body
};

struct EmbeddingStep {
  enum class Kind : std::uint8_t {
    sweep,   // bodies as in an open tree
    gear,    // bodies each with the wheel that turns with its hinge
    chain,   // bodies of geared chains
    geared,  // bodies each with the wheels of transmissions that turn with its hinge
    cross,   // one body whose hinge is eliminated, with pending coordinates on it
    item,    // one body whose hinge rates a loop has taken up
    branch,  // a chain of such bodies, all of one loop, that no coordinates of others are on
    wheel,   // the same of a rotor that is folded into its carrier
    modes,   // of one body of a general kernel, with pending coordinates on it: its modes are eliminated
    hinge,   // ... and its hinge
    close    // the loop is closed at home
  };
  static constexpr int kBranchRates = 6;  // most hinge rates of a branch: beyond, differences of motions that nearly cancel would be formed
  Kind kind = Kind::sweep;
  int run = 0, begin = 0,
      end = 0;                     // sweep, cross; of gear, chain and geared: indices into Embedding::alike_gears, ::alike_chains, ::geared
  int body = 0;                    // cross, item, wheel; of branch: the innermost; of close: home
  int loop = -1;                   // item, branch, wheel, close
  std::vector<PendingFlow> flows;  // item: that of its loop first; close: likewise, then what it is coupled with
  int coupled = 0;                 // close: so many of these; who takes up what is kept comes last where it is not
  std::vector<CoordinateBlock> blocks;  // flows x flows
  int motion = -1;                      // item, wheel: column of EmbeddingWork::U
  int column = 0;                       // item, wheel: of the loop
  bool to_carried = false;              // item: it passes the inboard body
  int carried = -1;                     // item: index of what passes it; -1: nothing
  int carried_to = -1;
  int Y = -1;  // cross, hinge
  struct Couple {
    int flow, component;
    int gradient;  // index into EmbeddingWork::gradients
  };
  struct BranchBody {
    int body, column;     // of the loop
    bool shifts = false;  // as EmbeddedLoop::PathBody
  };
  std::vector<BranchBody> branch;  // tip to base, `body` the last; flows has its loop
  bool rigid = false;              // branch: nothing hangs on it, but for rotors
  std::vector<Couple> couples;     // cross, hinge: multipliers of couplings of this hinge
  bool after_modes = false;        // close: home is a body without its modes
};

/// n loops (2 or 4), one closed behind the other, by rates, by ends that meet in as many directions: their ways to both ends are alike,
/// body by body of one kernel or the very body that loops before have found. Their rows are found side by side.
struct AlikeRows {
  static constexpr int kMost = AlikeHinges::kMost, kMostBodies = 8, kMostNumbers = 48;  // of one of them: on its way, in G
  struct Body {
    AlikeHinges hinges;                         // of a slide: body and v
    double p[3][kMost] = {}, u[3][kMost] = {};  // [m] as AxisBody; axis of a slide
  };
  int first = 0, n = 0;      // index into Embedding::loops
  bool half = false;         // as AlikeGears
  std::vector<Body> bodies;  // of the way; of those found before nothing
  double from_R[9][kMost] = {}, from_p[3][kMost] = {}, to_p[3][kMost] = {};
};

struct Embedding {
  std::vector<EmbeddedLoop> loops;  // in the order in which they are closed
  std::vector<Gear> gears;          // tip to base
  std::vector<Transmission> transmissions;
  std::vector<TurningWheel> wheels;  // of transmissions
  std::vector<GearedChain> chains;   // of few hinges
  std::vector<GearedHinge> geared;   // of more, tip to base
  std::vector<AlikeGears> alike_gears;
  std::vector<AlikeChains> alike_chains;
  std::vector<AlikeRows> alike_rows;
  std::vector<EmbeddingStep> steps;  // tip to base
  /// Pushes of multipliers on bodies: +1 of the end `from`, -1 of `to`.
  struct Push {
    int loop, body, own;
    double sign;
    int modes = -1;  // on the modes of the body: where its node deforms
  };
  std::vector<Push> pushes;
  int n_numbers = 0, n_Q = 0, n_U = 0, n_carried = 0, n_x = 0, n_rows = 0, n_path = 0, n_Y = 0, n_pivots = 0, n_gradients = 0;
  int n_modal = 0, n_scratch = 0, n_ratios = 0, n_pairs = 0, n_angles = 0;
  bool chosen = false;        // some loop has rows that count chosen at the start
  int n_zeroed = 0;           // of numbers: A comes first
  int width = 0;              // most coordinates on a body
  long flops = 0;             // of the op, counted by formula
  std::vector<int> factored;  // bodies whose modes pending coordinates cross
};

}  // namespace cardan
