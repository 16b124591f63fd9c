#pragma once
// Wheels that turn with hinges: couplings that are no loops in the sweeps, but more inertia of these hinges (docs/mathematics/loops.md, 4).
#include <cstdint>
#include <vector>

#include "core/model/coupling.hpp"
#include "core/model/sweep_model.hpp"
#include "core/spatial/vec3.hpp"

namespace cardan {

struct Model;

/// A wheel that turns with the hinge of another body on its carrier, about the same direction: a linear coupling of these two rates and
/// nothing else.
struct Gear {
  int body = 0, wheel = 0;
  int row = 0;  // of all rows
  int drive = -1;
  int v = 0;           // of the wheel
  double sense = 1.0;  // of the axis of the wheel along that of the hinge: 1 or -1
  double ratio = 0.0;  // r: v'_wheel = sense r v'_body + per_slope * (what G v' is to be)
  double per_slope = 0.0;
  double J_axial = 0.0, coupled = 0.0, reflected = 0.0;  // Ja, r Ja, r^2 Ja
};

/// Hinges of bodies that turn about an axis of their own, all of one kernel and none outboard of another, side by side: the sweeps take one
/// number of each in one instruction. What the kernels read of AxisBody, body by body.
struct AlikeHinges {
  static constexpr int kMost = 4;
  BodyKernel kind = BodyKernel::fixed;
  int body[kMost] = {}, parent[kMost] = {}, v[kMost] = {}, angle[kMost] = {};
  double cos_alpha[kMost] = {}, sin_alpha[kMost] = {}, cos_beta[kMost] = {}, sin_beta[kMost] = {}, l[2][kMost] = {};
  void set(int i, const Model& model, int k);
};

/// n gears (1, 2 or 4) with such hinges; numbers as in Gear.
struct AlikeGears {
  static constexpr int kMost = AlikeHinges::kMost;
  int n = 0;
  AlikeHinges hinges;
  int wheel[kMost] = {}, row[kMost] = {}, drive[kMost] = {}, v[kMost] = {};
  bool driven = false;  // any of them
  bool half = false;    // of the four before, for processors whose registers hold two numbers
  double sense[kMost] = {}, ratio[kMost] = {}, per_slope[kMost] = {}, J_axial[kMost] = {}, coupled[kMost] = {}, reflected[kMost] = {};
};

/// Sines and cosines of a coupling as a sum of S sin x + C cos x, x = sum of a q: one for each x, four side by side.
struct Sinusoids {
  static constexpr int kSide = 4;
  int terms = 0;
  /// Of each block of four: S, C, and a of each term.
  std::vector<double> numbers;
  std::vector<int> others;  // functions of the coupling that are neither

  Sinusoids() = default;
  explicit Sinusoids(const Coupling& coupling);
  int angles() const { return static_cast<int>(numbers.size()) / (2 + terms); }  // with those that fill the last block
};

/// As many couplings as wheels, on one carrier, whose rates follow from those of hinges on one way outward: v'_w = R v'_h + t. Nothing else
/// has these wheels.
struct Transmission {
  struct Row {
    int loop = 0;  // index into Loops::all
    int row = 0;   // of all rows
    int drive = -1;
    Coupling coupling;
    Sinusoids sinusoids;
    int angles = 0;           // EmbeddingWork::angles
    std::vector<int> column;  // per term: index into `wheels`, or after these into `way`
  };
  std::vector<Row> rows;
  std::vector<int> wheels, way;  // bodies; those of the way from the carrier outward
  bool constant = false;         // R is the same in each evaluation, and t zero but where G v' is to be something
  std::vector<double> steepest;  // wheels x way: most that R may be; beyond, other rates should follow
  int numbers = 0;               // EmbeddingWork::ratios: R (wheels x way), t, and the inverse of the slopes of the wheels (wheels x rows)
};

/// A wheel of a transmission, on its way to its carrier: s = u* delta_carrier + v'_wheel - t is a coordinate of the bodies between.
struct TurningWheel {
  int body = 0, carrier = 0, v = 0;
  double J_axial = 0.0;
  Vec3<double> u;     // in the carrier
  int t = 0;          // EmbeddingWork::ratios
  int on_ground = 0;  // 1 + axis in its own frame: its z is that of a body; 0: it is folded into its carrier
};

/// A hinge that wheels of transmissions turn with.
struct GearedHinge {
  static constexpr int kMost = 8;
  struct Turn {
    int wheel = 0;                      // index into Embedding::wheels
    int ratio = 0;                      // EmbeddingWork::ratios
    bool begins = false, ends = false;  // it is the outermost hinge of the way, the one on the carrier
  };
  int body = 0;
  std::vector<Turn> turns;
  int A = 0;               // EmbeddingWork::pairs: inertia between wheels, n x n, on its way on; then what v' takes of each s
  std::vector<int> pairs;  // n x n: where they stand from the hinge before; -1: nothing is there
};

/// Hinges one outboard of the other, the first on the carrier, and all wheels there that turn with any of them: eliminated together, where
/// no wheel of another carrier turns with them.
struct GearedChain {
  static constexpr int kMost = 3;  // hinges
  struct Wheel {
    int wheel = 0;                    // index into Embedding::wheels
    int ratio[kMost] = {-1, -1, -1};  // EmbeddingWork::ratios, per hinge; -1: it is not on its way
  };
  std::vector<int> hinges;  // bodies, tip to base
  std::vector<Wheel> wheels;
  int carrier = 0;
};

/// n geared chains (1, 2 or 4) of as many hinges, one beside the other alike, and as many wheels that turn with the same of them.
struct AlikeChains {
  struct Wheels {
    int wheel[AlikeHinges::kMost] = {}, body[AlikeHinges::kMost] = {}, v[AlikeHinges::kMost] = {};  // wheel: index into Embedding::wheels
    double u[3][AlikeHinges::kMost] = {}, J_axial[AlikeHinges::kMost] = {};
    int t[AlikeHinges::kMost] = {}, ratio[GearedChain::kMost][AlikeHinges::kMost] = {};  // as in TurningWheel and GearedChain::Wheel
  };
  int n = 0;
  std::vector<AlikeHinges> hinges;  // tip to base
  std::vector<Wheels> wheels;
  bool on_ground = false;  // wheels are bodies on the ground
  bool half = false;       // as AlikeGears
};

/// Those among the couplings that `may` be; hinges: of each loop, bodies whose hinges it has.
std::vector<Transmission> find_transmissions(const Model& model, const std::vector<double>& scaled_rows,
                                             const std::vector<std::vector<int>>& hinges, const std::vector<std::uint8_t>& may);

/// u of a wheel in its carrier, and the axis of a hinge there.
Vec3<double> axis_on_carrier(const Model& model, int body);

}  // namespace cardan
