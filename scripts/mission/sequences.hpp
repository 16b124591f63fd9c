#pragma once
// Plans that a script writes from top to bottom: coroutines that wait for instants and conditions. MissionRun says when one goes on; here
// is what each waits for. A coroutine cannot be stored: what a plan was answered and given is kept, and a run that is resumed goes through
// the plan once more with that, while nothing that it asks for or commands reaches the vehicle (docs/results.md, "Resuming").
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/warnings.hpp"
#include "core/sim/simulation.hpp"
#include "scripts/lua/function.hpp"
#include "scripts/lua/persist.hpp"

namespace cardan {

/// What plans need of their mission.
struct PlannedMission {
  LuaHost& lua;
  Persistent& persistent;
  const std::unique_ptr<Simulation>& sim;
  bool& in_event_function;
  double& trial_time;  // [s] of it
};

class Sequences final : public LuaHost::Tape {
 public:
  /// Of the run, exact where it is a ratio of whole numbers.
  struct Moment {
    double t = std::numeric_limits<double>::infinity();  // [s]
    std::optional<Instant> exact{};
    void remember(Archive& archive);
  };
  /// `duration` [s] after `from`.
  static Moment after(const Moment& from, double duration);
  static Moment moment(double t) { return {t, to_instant(t)}; }

  enum class Kind { none, instant, located, looked };
  struct Wait {
    Kind kind = Kind::none;
    Moment until;          // its end; of a condition its timeout
    Moment look;           // of a condition that is looked at: when, next
    Rational period;       // ... and how often
    int side = 0;          // of a condition that is located: 1 where its number rises through zero, -1 where it falls, 0: either
    std::string told, at;  // "10 s", "a zero, located"; "scenario.lua:12"
    std::string late;      // "timeout of 100 s"
    std::string text() const;
    void remember(Archive& archive);
  };

  enum class State { idle, ready, waiting, running, ended, stopped };
  static const char* name_of(State state);

  struct Sequence {
    std::string name;
    LuaFunction run;
    bool starts = true;  // with the run
    SourceMark declared;
    State state = State::idle;
    Wait wait{};
    LuaFunction when{};  // of a wait for a condition
    /// What a call gave, value by value; `again`: handles, which are made anew.
    struct Call {
      bool again = false;
      std::vector<std::vector<std::string>> values;
      void remember(Archive& a) { a(again, values); }
    };
    /// From one wait to the next.
    struct Stretch {
      std::vector<std::string> answer;     // of the wait before: whether a condition holds
      std::vector<double> memory_numbers;  // of persist{} at its beginning; nothing: as at the one before
      std::vector<std::string> memory;
      std::vector<Call> calls;
      void remember(Archive& a) { a(answer, memory_numbers, memory, calls); }
    };

   private:
    friend class Sequences;
    LuaRef thread_;
    lua_State* coroutine_ = nullptr;
    Moment now_;  // while it runs
    /// The number of a condition that is located, in its wait: on which side it began, and how large it was at most.
    struct {
      int side = 0;
      double largest = 0.0;
    } seen_;
    /// The last zero: of a number that is as small as rounding in the same instant, it has passed to this side.
    struct {
      double t = std::numeric_limits<double>::quiet_NaN();
      int side = 0;
      double largest = 0.0;
    } passed_;
    std::vector<Stretch> journal_;
    std::size_t kept_ = 0;            // values in it
    std::string lost_;                // what it cannot hold; empty: it holds all
    CheckpointBlock memory_;          // the last of the journal
    std::vector<std::string> stack_;  // where it stands, in a checkpoint that was read
  };

  explicit Sequences(const PlannedMission& scenario) : s_(scenario) {}

  // What a script says ---------------------------------------------------------------------------------------------------
  int declare(std::string name, LuaFunction run, bool starts, SourceMark at);
  bool empty() const { return all_.empty(); }
  const std::deque<Sequence>& all() const { return all_; }
  /// Which values are handles, made anew from the same names.
  void know_handles(bool (*is_handle)(lua_State*, int)) { is_handle_ = is_handle; }
  /// Of a function that only a sequence may call, in itself: C0502 elsewhere.
  Sequence& asking(lua_State* L, const char* what);
  const Moment& now(const Sequence& me) const { return me.now_; }
  /// Whether what the sequence asks for is there already; `look` finds out.
  bool at_once(Sequence& me, const std::function<bool()>& look);
  /// The value of the condition at `index` as it is now: located a finite number, else 1 or 0.
  double look(lua_State* L, int index, bool located);
  /// Whether the number of a condition that is located is where the wait wants it, as it begins.
  bool has_passed(Sequence& me, const Wait& wait, double x) const;
  /// It waits from now on: what wait() and the like return. With a condition, the function at 1; with `otherwise`, the function at 3, that
  /// is what follows a timeout.
  int pause(lua_State* L, Sequence& me, Wait wait, bool condition = false);
  void start(lua_State* L, int index, bool before_run);
  int stop(lua_State* L, int index);

  // The run --------------------------------------------------------------------------------------------------------------
  /// All of them from the beginning; `note` is told what each does. `keeps`: a journal, for checkpoints.
  void begin(bool keeps, std::function<void(const Sequence&, const std::string&)> note);
  /// Nobody is told any more.
  void end() { note_ = nullptr; }
  /// [s] when one goes on next; infinite: none, lowest(): at once.
  double next() const;
  /// The first, in the order of declaration, that goes on by t; -1: none does.
  int due(double t) const;
  /// One that is due goes on, as far as its next wait.
  void go_on(int index);
  /// It waits for the zero of a number: of one that comes from a given side, or from either.
  bool is_located(int index, bool from_a_side) const;
  /// What that number is, at some state that is tried.
  double seen(int index, double x);
  /// The condition of its wait holds, which is located.
  void crossed(int index);
  /// What they still wait for, and which were never started.
  Warnings unfinished() const;
  /// Why a checkpoint does not hold them.
  std::vector<std::string> lost();
  /// Reading, they are where they were; what persist{} holds has to be read after that, and expect_standing() be called.
  void remember(Archive& archive);
  void expect_standing(const Archive& archive);

  int call(lua_State* L, lua_CFunction function) override;
  bool is_played() const override { return played_ != nullptr; }

 private:
  static int answered(lua_State* L, int status, lua_KContext context);
  static int branched(lua_State* L, int status, lua_KContext context);
  void make_coroutine(Sequence& me);
  void resume(Sequence& me, std::optional<bool> answer);
  bool advance(Sequence& me, std::optional<bool> answer);
  void close(Sequence& me);
  void leave(Sequence& me);
  void keep_stretch(Sequence& me, std::optional<bool> answer);
  void keep(Sequence& me, std::size_t values);
  void lose(Sequence& me, std::string why);
  void replay(Sequence& me, const Archive& archive);
  void note(const Sequence& me, const std::string& what) const {
    if (note_) note_(me, what);
  }

  PlannedMission s_;
  std::deque<Sequence> all_;  // where they are they stay: coroutines know it
  std::function<void(const Sequence&, const std::string&)> note_;
  bool (*is_handle_)(lua_State*, int) = nullptr;
  Sequence* running_ = nullptr;
  bool keeps_ = false;                         // a journal, for checkpoints
  const Sequence::Stretch* played_ = nullptr;  // while a run that is resumed goes through it
  std::size_t at_ = 0;                         // calls of it that were given
  const Archive* archive_ = nullptr;           // likewise
};

}  // namespace cardan
