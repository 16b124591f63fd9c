#pragma once
// The stages in which embed_loops() writes its program (embed_loops.hpp), a page each, in this order:
//   Ways                 the way of each loop, as the model has it        embedding_ways.cpp
//   place_wheels         couplings that are wheels of hinges              embedding_wheels.cpp
//   order_loops          who takes up which rates                         embedding_order.cpp
//   find_branches        chains of bodies that are assembled together     embedding_numbers.cpp
//   place_numbers        where the numbers of each loop stand             embedding_numbers.cpp
//   write_steps          the steps, tip to base                           embedding_steps.cpp
//   place_side_by_side   what is alike, in lanes                          embedding_side_by_side.cpp
#include <string>

#include "core/model/embedding.hpp"
#include "core/model/model.hpp"

namespace cardan::embedding_stages {

template <class Int>
std::size_t at(Int i) {
  return static_cast<std::size_t>(i);
}

/// Per loop: by rates (1) or by multipliers in the sweep (0).
using ByRates = std::vector<std::uint8_t>;

/// The ways of the loops of a model: everything that does not depend on how they are closed.
struct Ways {
  /// scaled_rows: rows x nv, of which ranks are taken.
  Ways(const Model& model, const std::vector<double>& scaled_rows);

  const Model& model;
  const std::vector<double>& rows;
  std::vector<int> body_of;              // of a hinge rate
  std::vector<std::vector<int>> hinges;  // per loop: bodies whose hinges it has, ascending
  std::vector<int> home;                 // per loop
  std::vector<std::uint8_t> meets;       // per loop: modes of home are on its way
  std::vector<std::uint8_t> stops;       // per body: its motion by a loop is counted from its inboard body

  const SweepBody& body(int k) const { return model.bodies[at(k)]; }
  const Loop& loop(int l) const { return model.loops.all[at(l)]; }
  bool is_given(int v) const { return model.has_prescribed() && model.prescribed[at(v)]; }
  bool deforms(int shapes) const { return shapes >= 0 && model.shapes[at(shapes)].deforms(); }
  bool deforms(const LoopEnd& end) const { return end.node >= 0 && model.nodes[at(end.node)].shapes.deforms(); }
  /// A slide with the axes of the inboard body.
  bool shifts(int k) const;
  /// Why the rates of a loop cannot be its coordinates: modes are on its way. Empty: they can.
  std::string modes_on_the_way(int l) const;

 private:
  int ancestor(int a, int b) const;
  bool meets_modes_of_home(int l) const;
  void stop_at_gaps(int l);
};

/// What an attempt to write the steps has found and the next one avoids.
struct Avoided {
  explicit Avoided(const Model& model) : crossed(model.loops.all.size()), plain(model.bodies.size()) {}
  std::vector<std::uint8_t> crossed;  // per loop: coordinates of others cross the hinge that its wheels would be one with
  std::vector<std::uint8_t> plain;    // per body, the innermost of a branch: it forks, or coordinates of others are on it
};

constexpr int kWheel = -2;  // among Wheels::geared_of: the wheel of a transmission

/// Which bodies are in Embedding::gears, ::transmissions and what follows of these.
struct Wheels {
  std::vector<std::vector<int>> turning;          // per body: loops that are transmissions with its hinge
  std::vector<int> gear_of, geared_of, chain_of;  // per body, index into Embedding::gears, ::geared, ::chains; -1: none
  std::vector<std::uint8_t> taken;                // per loop: wheels do what it asks for
};
Wheels place_wheels(const Ways& ways, const ByRates& by_rates, const Avoided& avoided, Embedding& e);

/// Fills Embedding::loops, outermost homes first. Per body: which of them takes up its hinge rates, -1: none.
std::vector<int> order_loops(const Ways& ways, const ByRates& by_rates, const Wheels& wheels, Embedding& e);

/// What the bodies that loops have taken up are assembled on, and chains of them that move by the hinge rates of one loop alone.
struct Branches {
  std::vector<int> base;    // per body taken up: what its motion is counted from
  std::vector<int> branch;  // per body: the innermost of its chain; -1: it is taken up by itself, or not at all
  std::vector<int> tip;     // per such: the outermost
};
Branches find_branches(const Ways& ways, const std::vector<int>& owner, Avoided& avoided, const Embedding& e);
void place_numbers(const Ways& ways, const std::vector<int>& owner, const Branches& branches, Embedding& e);

/// False: coordinates of a loop cross what was to be one step, which is avoided from now on.
bool write_steps(const Ways& ways, const Wheels& wheels, const std::vector<int>& owner, const Branches& branches, Avoided& avoided,
                 Embedding& e);

/// Gears, geared chains and rows of loops that are alike, four or two at a time.
void place_side_by_side(const Model& model, Embedding& e);

}  // namespace cardan::embedding_stages
