#include "scripts/mission/sequences.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace cardan {
namespace {

constexpr double kForever = std::numeric_limits<double>::infinity();
constexpr std::size_t kMostKept = 200'000;  // values of a journal

/// Something is another value as long as this is there.
template <class T>
struct Meanwhile {
  Meanwhile(T& of, T value) : what(of), before(std::exchange(of, value)) {}
  ~Meanwhile() { what = before; }
  Meanwhile(const Meanwhile&) = delete;
  Meanwhile& operator=(const Meanwhile&) = delete;
  T& what;
  T before;
};
std::string place_text(const SourceMark& mark) { return fmt::format("{}:{}", mark.file.substr(mark.file.rfind('/') + 1), mark.line); }

}  // namespace

const char* Sequences::name_of(State state) {
  constexpr const char* kNames[] = {"idle", "ready", "waiting", "running", "ended", "stopped"};
  return kNames[static_cast<int>(state)];
}

void Sequences::Moment::remember(Archive& a) {
  Instant i = exact.value_or(Instant{0, 0, 0});
  a(t, i.whole, i.part, i.unit);
  exact = i.unit > 0 ? std::optional(i) : std::nullopt;
  if (std::isnan(t) || (exact && (i.part < 0 || i.part >= i.unit || i.seconds() != t))) a.wrong("a moment that is none");
}

Sequences::Moment Sequences::after(const Moment& from, double duration) {
  if (from.exact)
    if (const auto sum = later(*from.exact, duration)) return {sum->seconds(), sum};
  return moment(from.t + duration);
}

std::string Sequences::Wait::text() const { return fmt::format("{}{} ({})", told, late.empty() ? "" : ", " + late, at); }

void Sequences::Wait::remember(Archive& a) {
  int of_kind = static_cast<int>(kind);
  a(of_kind, until, look, period.numerator, period.denominator, side, told, at, late);
  kind = static_cast<Kind>(of_kind);
  const auto fits = [](std::int64_t n) { return n > 0 && n <= Rational::kLargest; };
  if (of_kind < 0 || of_kind > static_cast<int>(Kind::looked) || side < -1 || side > 1 ||
      (kind == Kind::looked && (!fits(period.numerator) || !fits(period.denominator))))
    a.wrong("a wait of no kind");
}

// ---- what a script says ----

int Sequences::declare(std::string name, LuaFunction run, bool starts, SourceMark at) {
  Sequence& me = all_.emplace_back();
  me.name = std::move(name), me.run = std::move(run), me.starts = starts, me.declared = std::move(at);
  return static_cast<int>(all_.size()) - 1;
}

Sequences::Sequence& Sequences::asking(lua_State* L, const char* what) {
  if (!running_ || running_->coroutine_ != L)
    refuse(L, Code::lua_argument, what, "a call from the function of a sequence{...}",
           running_ ? "one from a coroutine within it" : "one from elsewhere",
           running_ ? "" : "controllers, phases and events do not wait: they are called when it is time");
  return *running_;
}

bool Sequences::at_once(Sequence& me, const std::function<bool()>& look) {
  if (played_) {
    const bool more = at_ < played_->calls.size();
    at_ += more;
    return more;
  }
  if (!look()) return false;
  if (keeps_ && me.lost_.empty()) me.journal_.back().calls.emplace_back(), keep(me, 1);
  return true;
}

double Sequences::look(lua_State* L, int index, bool located) {
  const LuaHost::Taping none(s_.lua, nullptr);
  const Meanwhile trial(s_.in_event_function, located);
  s_.trial_time = s_.sim->time();
  luaL_checkstack(L, LUA_MINSTACK, nullptr);
  lua_pushvalue(L, index);
  lua_pushnumber(L, s_.sim->time());
  const int before = lua_gettop(L) - 2;
  lua_call(L, 1, LUA_MULTRET);
  const int results = lua_gettop(L) - before;
  lua_settop(L, before + 1);
  const int type = lua_type(L, -1);
  const double value = located ? lua_tonumber(L, -1) : lua_toboolean(L, -1);
  const bool good = located ? results == 1 && type == LUA_TNUMBER && std::isfinite(value) : type == LUA_TBOOLEAN || type == LUA_TNIL;
  if (!good) {
    lua_pushvalue(L, index);
    throw InputError(Diagnostic{Code::lua_runtime,
                                {"result of the condition", s_.lua.definition(L, -1)},
                                located ? "a finite number, which is located where it crosses zero" : "true or false",
                                located && results > 1 ? fmt::format("{} values", results) : describe_value(L, -2),
                                located ? "what is true or false is looked at: wait_until(f, { rate = \"10 Hz\" })"
                                        : "a number is located where it crosses zero: no `rate` then",
                                LuaHost::traceback(L)});
  }
  lua_pop(L, 1);
  return value;
}

bool Sequences::has_passed(Sequence& me, const Wait& wait, double x) const {
  constexpr double kRounding = 1e-9;  // of the largest: zeros are located to some 1e-13 of a step
  me.seen_ = {(x > 0.0) - (x < 0.0), std::abs(x)};
  if (wait.side == 0) return false;
  const auto& passed = me.passed_;
  if (passed.side != 0 && passed.t == me.now_.t && std::abs(x) <= kRounding * passed.largest) return wait.side == passed.side;
  return x * wait.side >= 0.0;
}

int Sequences::pause(lua_State* L, Sequence& me, Wait wait, bool condition) {
  wait.at = place_text(LuaHost::caller(L));
  if (wait.kind == Kind::located && !played_) s_.sim->events_changed();
  me.wait = std::move(wait);
  me.state = State::waiting;
  me.when = LuaFunction();
  if (condition) {
    lua_pushvalue(L, 1);
    me.when = LuaFunction(LuaRef::pop(L));
  }
  return lua_yieldk(L, 0, reinterpret_cast<lua_KContext>(&me), answered);
}

/// A wait is over, and its answer at the top; arguments of wait_until below it: condition, options, what follows a timeout.
int Sequences::answered(lua_State* L, int, lua_KContext context) {
  if (lua_gettop(L) < 4 || lua_toboolean(L, -1) || lua_isnil(L, 3)) return lua_gettop(L) > 3 ? 1 : 0;
  lua_settop(L, 3);
  lua_callk(L, 0, 0, context, branched);
  return branched(L, LUA_OK, context);
}

/// What followed a timeout has ended, and with it the sequence.
int Sequences::branched(lua_State* L, int, lua_KContext context) {
  reinterpret_cast<Sequence*>(context)->state = State::ended;
  return lua_yield(L, 0);
}

void Sequences::start(lua_State* L, int index, bool before_run) {
  Sequence& me = all_[static_cast<std::size_t>(index)];
  if (before_run) {
    me.starts = true;
    return;
  }
  if (me.state == State::ready || me.state == State::waiting || me.state == State::running)
    refuse(L, Code::lua_argument, fmt::format("start of sequence \"{}\"", me.name), "one that is not under way", name_of(me.state),
           "deploy:state() tells, deploy:stop() ends it");
  me.state = State::ready;
}

int Sequences::stop(lua_State* L, int index) {
  Sequence& me = all_[static_cast<std::size_t>(index)];
  if (me.state == State::running) {
    if (L != me.coroutine_)
      refuse(L, Code::lua_argument, fmt::format("stop of sequence \"{}\"", me.name), "a call from its own function, or from elsewhere",
             "one from a coroutine within it");
    me.state = State::stopped;
    return lua_yield(L, 0);
  }
  if (me.state != State::ready && me.state != State::waiting) return 0;
  leave(me);
  me.state = State::stopped;
  close(me);
  note(me, "stopped");
  return 0;
}

// ---- the run ----

void Sequences::begin(bool keeps, std::function<void(const Sequence&, const std::string&)> note) {
  note_ = std::move(note);
  keeps_ = keeps;
  for (Sequence& me : all_) {
    close(me);
    me.wait = {};
    me.state = me.starts ? State::ready : State::idle;
  }
}

double Sequences::next() const {
  double t = kForever;
  for (const Sequence& me : all_) {
    if (me.state == State::ready) return std::numeric_limits<double>::lowest();
    if (me.state == State::waiting) t = std::min({t, me.wait.until.t, me.wait.look.t});
  }
  return t;
}

int Sequences::due(double t) const {
  const auto found = std::ranges::find_if(all_, [t](const Sequence& me) {
    return me.state == State::ready || (me.state == State::waiting && std::min(me.wait.until.t, me.wait.look.t) <= t);
  });
  return found == all_.end() ? -1 : static_cast<int>(found - all_.begin());
}

void Sequences::go_on(int index) {
  Sequence& me = all_[static_cast<std::size_t>(index)];
  const double t = s_.sim->time();
  if (me.state == State::ready) {
    me.now_ = moment(t);
    make_coroutine(me);
    note(me, "begins");
    return resume(me, {});
  }
  const bool over = me.wait.until.t <= t;
  me.now_ = over ? me.wait.until : me.wait.look;
  if (me.wait.kind == Kind::instant) {
    note(me, me.wait.told + " " + me.wait.at);
    return resume(me, {});
  }
  if (me.wait.kind == Kind::looked && me.wait.look.t <= t) {
    bool holds = false;
    s_.lua.protect(
        [&](lua_State* L) {
          me.when.push(L);
          holds = look(L, lua_gettop(L), false) != 0.0;
        },
        s_.lua.call_budget());
    if (!holds && !over) {
      const Instant next = next_tick(me.wait.period, t);
      me.wait.look = {next.seconds(), next};
      return;
    }
    if (holds) {
      note(me, "holds " + me.wait.at);
      return resume(me, true);
    }
  }
  leave(me);
  note(me, me.wait.late + " " + me.wait.at);
  resume(me, false);
}

bool Sequences::is_located(int index, bool from_a_side) const {
  const Sequence& me = all_[static_cast<std::size_t>(index)];
  return me.state == State::waiting && me.wait.kind == Kind::located && (me.wait.side != 0) == from_a_side;
}

double Sequences::seen(int index, double x) {
  Sequence& me = all_[static_cast<std::size_t>(index)];
  me.seen_.largest = std::max(me.seen_.largest, std::abs(x));
  return x;
}

void Sequences::crossed(int index) {
  Sequence& me = all_[static_cast<std::size_t>(index)];
  me.now_ = moment(s_.sim->time());
  me.passed_ = {me.now_.t, me.wait.side != 0 ? me.wait.side : -me.seen_.side, me.seen_.largest};
  note(me, "zero " + me.wait.at);
  resume(me, true);
}

/// The function of an event is no condition any more.
void Sequences::leave(Sequence& me) {
  if (me.state == State::waiting && me.wait.kind == Kind::located) s_.sim->events_changed();
}

void Sequences::make_coroutine(Sequence& me) {
  close(me);
  s_.lua.protect([&me](lua_State* L) {
    me.coroutine_ = lua_newthread(L);
    me.thread_ = LuaRef::pop(L);
    me.run.push(L);
    lua_xmove(L, me.coroutine_, 1);
  });
}

/// Variables that are to be closed are, in a coroutine that waits.
void Sequences::close(Sequence& me) {
  if (me.coroutine_ && lua_status(me.coroutine_) == LUA_YIELD)
    s_.lua.protect(
        [&me](lua_State* L) {
          if (lua_resetthread(me.coroutine_) == LUA_OK) return;
          lua_xmove(me.coroutine_, L, 1);
          lua_error(L);
        },
        s_.lua.call_budget());
  me.coroutine_ = nullptr;
  me.thread_ = LuaRef();
  me.when = LuaFunction();
  me.journal_.clear();
  me.kept_ = 0;
  me.lost_.clear();
  me.memory_ = {};
}

/// True: it waits again.
bool Sequences::advance(Sequence& me, std::optional<bool> answer) {
  bool yielded = false;
  me.state = State::running;
  try {
    s_.lua.protect(
        [&](lua_State* L) {
          const Meanwhile running(running_, &me);
          const LuaHost::Taping taping(s_.lua, played_ || keeps_ ? this : nullptr);
          if (answer) lua_pushboolean(me.coroutine_, *answer);
          yielded = s_.lua.resume(L, me.coroutine_, answer ? 1 : 0);
          if (yielded && me.state == State::running)
            refuse(me.coroutine_, Code::lua_argument, fmt::format("sequence \"{}\"", me.name), "wait, wait_until or at", "coroutine.yield",
                   "nothing would tell when it goes on");
        },
        s_.lua.call_budget());
  } catch (...) {  // at the workbench the run may go on without it
    me.state = State::stopped;
    throw;
  }
  if (!yielded) me.state = State::ended;
  return me.state == State::waiting;
}

void Sequences::resume(Sequence& me, std::optional<bool> answer) {
  keep_stretch(me, answer);
  if (advance(me, answer)) return;
  close(me);
  note(me, me.state == State::ended ? "ends" : "stopped");
}

Warnings Sequences::unfinished() const {
  Warnings found;
  for (const Sequence& me : all_)
    if (me.state == State::waiting || me.state == State::idle || me.state == State::ready)
      found.add(Code::no_effect, {fmt::format("sequence \"{}\"", me.name), me.declared},
                me.state == State::waiting ? "it still waited for " + me.wait.text() : "nothing has started it");
  return found;
}

// ---- checkpoints ----

void Sequences::keep_stretch(Sequence& me, std::optional<bool> answer) {
  if (!keeps_ || !me.lost_.empty()) return;
  Archive archive;
  archive.block("script")(s_.persistent);
  const CheckpointBlock memory = archive.checkpoint().at("script");
  Sequence::Stretch& stretch = me.journal_.emplace_back();
  if (answer) stretch.answer = {*answer ? "true" : "false"};
  if (memory != me.memory_) {
    stretch.memory_numbers = memory.numbers, stretch.memory = memory.texts;
    me.memory_ = memory;
  }
  keep(me, 1 + stretch.memory.size());
}

void Sequences::keep(Sequence& me, std::size_t values) {
  me.kept_ += values;
  if (me.kept_ > kMostKept) lose(me, fmt::format("more than {} values that it was given", kMostKept));
}

void Sequences::lose(Sequence& me, std::string why) {
  me.lost_ = std::move(why);
  me.journal_.clear();
}

/// What a sequence asks the vehicle for and tells it.
int Sequences::call(lua_State* L, lua_CFunction function) {
  Sequence& me = *running_;
  const LuaHost::Taping none(s_.lua, nullptr);
  if (played_) {
    if (at_ == played_->calls.size()) throw CheckpointFault("it asks for more than it was given");
    const Sequence::Call& given = played_->calls[at_++];
    if (given.again) return function(L);
    lua_settop(L, 0);
    luaL_checkstack(L, static_cast<int>(given.values.size()) + LUA_MINSTACK, nullptr);
    for (const auto& texts : given.values) s_.persistent.read(L, *archive_, texts);
    return static_cast<int>(given.values.size());
  }
  int n = 0;
  try {
    n = function(L);
  } catch (...) {  // of Lua's own kind too: the run ends with it, or the script catches it
    lose(me, "an error that it caught");
    throw;
  }
  if (!me.lost_.empty()) return n;
  Sequence::Call given;
  std::size_t size = 1;
  for (int i = lua_gettop(L) - n + 1; i <= lua_gettop(L); ++i) {
    given.again = given.again || is_handle_(L, i);
    if (given.again) continue;
    lua_pushvalue(L, i);
    const bool whole = s_.persistent.write(L, given.values.emplace_back());
    lua_pop(L, 1);
    size += given.values.back().size();
    if (whole) continue;
    lose(me, fmt::format("a {} that it was given ({})", luaL_typename(L, i), place_text(LuaHost::caller(L))));
    return n;
  }
  me.journal_.back().calls.push_back(std::move(given));
  keep(me, size);
  return n;
}

std::vector<std::string> Sequences::lost() {
  std::vector<std::string> all;
  for (Sequence& me : all_) {
    if (me.state != State::waiting) continue;
    std::vector<std::string> shared;
    if (me.lost_.empty()) s_.persistent.stack_of(me.coroutine_, shared);
    if (!me.lost_.empty()) shared = {me.lost_};
    for (const std::string& what : shared) all.push_back(fmt::format("sequence \"{}\": {}", me.name, what));
  }
  return all;
}

void Sequences::remember(Archive& a) {
  for (Sequence& me : all_) {
    int state = static_cast<int>(me.state);
    if (!a.reading() && me.state == State::waiting) {
      std::vector<std::string> shared;
      me.stack_ = s_.persistent.stack_of(me.coroutine_, shared);
    }
    a(state, me.wait, me.journal_, me.kept_, me.lost_, me.stack_);
    if (state < 0 || state > static_cast<int>(State::stopped) || static_cast<State>(state) == State::running)
      a.wrong("a sequence in no state");
    me.state = static_cast<State>(state);
    if (a.reading() && me.state == State::waiting) replay(me, a);
  }
}

/// From its beginning to where it waits, with what it was given then.
void Sequences::replay(Sequence& me, const Archive& a) {
  const auto wrong = [&](const std::string& why) { a.wrong(fmt::format("sequence \"{}\": {}", me.name, why)); };
  const Wait wait = me.wait;
  const std::vector<Sequence::Stretch> journal = std::move(me.journal_);
  const std::vector<std::string> stack = std::move(me.stack_);
  const std::size_t kept = me.kept_;
  const std::string lost = me.lost_;
  if (journal.empty()) wrong("nothing leads to where it waits");
  make_coroutine(me);
  me.now_ = moment(0.0);  // what it works out from there is not used
  const Meanwhile archive(archive_, &a);
  const Meanwhile played(played_, static_cast<const Sequence::Stretch*>(nullptr));
  try {
    for (const Sequence::Stretch& stretch : journal) {
      if (!stretch.memory.empty()) {
        me.memory_ = {stretch.memory_numbers, stretch.memory};
        Archive memory(Checkpoint{{"script", me.memory_}});
        memory.block("script")(s_.persistent);
      }
      played_ = &stretch;
      at_ = 0;
      const bool waits = advance(me, stretch.answer.empty() ? std::nullopt : std::optional(stretch.answer[0] == "true"));
      if (!waits || at_ != stretch.calls.size()) wrong("it does other things than before");
    }
  } catch (const InputError& e) {
    wrong(e.what());
  }
  if (me.wait.kind != wait.kind || me.wait.at != wait.at) wrong("it waits for something else than before");
  me.wait = wait;
  me.journal_ = journal, me.stack_ = stack, me.kept_ = kept, me.lost_ = lost;
}

void Sequences::expect_standing(const Archive& a) {
  for (Sequence& me : all_) {
    if (me.state != State::waiting) continue;
    std::vector<std::string> shared;
    const std::vector<std::string> now = s_.persistent.stack_of(me.coroutine_, shared);
    const auto [is, was] = std::ranges::mismatch(now, me.stack_);
    if (is != now.end() || was != me.stack_.end())
      a.wrong(fmt::format("sequence \"{}\": after {} it has {} in place of {}", me.name, is == now.begin() ? "its beginning" : *(is - 1),
                          is == now.end() ? "nothing" : *is, was == me.stack_.end() ? "nothing" : *was));
  }
}

}  // namespace cardan
