#include "core/model/device_order.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "core/abi/port_vectors.hpp"
#include "core/model/device_units.hpp"

namespace cardan {
namespace {

class DeviceOrder {
 public:
  DeviceOrder(const SystemSpec& spec, Devices& devices, DiagnosticSink& sink) : spec_(spec), devices_(devices), sink_(sink) {}

  bool find() { return in_one_evaluation() && at_one_tick(); }

 private:
  /// A device that gives something to another one; `waits`: that output needs a connected input of its own, so that the giver comes first.
  struct Giver {
    int device;
    bool waits;
    int in, out;  // numbers of the ports
  };
  /// A device that samples, and what the input of another one needs of it: the names of both ends.
  struct Sampled {
    int device;
    std::string link;
  };

  const Device& device(int i) const { return devices_.all[static_cast<std::size_t>(i)]; }
  int count() const { return static_cast<int>(devices_.all.size()); }
  static const char* input(const Device& d, int k) { return port_at(*d.family, CARDAN_PORT_IN, k).name; }
  static const char* output(const Device& d, int k) { return port_at(*d.family, CARDAN_PORT_OUT, k).name; }
  /// True if this output of `d` depends on that input in the same evaluation.
  static bool feeds_through(const Device& d, int out, int in) {
    return in >= 64 || (port_at(*d.family, CARDAN_PORT_OUT, out).direct >> in & 1U) != 0;
  }
  double offset_of(const Device& d) const { return spec_.devices[static_cast<std::size_t>(d.spec)].offset; }

  bool refuse(const Device& d, const char* expected, const std::vector<std::string>& links, const char* instead) const {
    sink_.report(
        Code::device_cycle, spec_.locate(fmt::format("devices.{}.inputs", d.name)), expected, fmt::format("{}", fmt::join(links, ", ")),
        fmt::format("`delay: 1` at one of these inputs (inputs: {{x: {{from: ..., delay: 1}}}}: what it was a tick ago), {}, or one "
                    "device in place of them",
                    instead));
    return false;
  }

  std::vector<Giver> givers_of(int i) const {
    std::vector<Giver> all;
    const Device& d = device(i);
    for (int k = d.in; k < d.in + d.n_in; ++k) {
      devices_.each_source(k, [&](int out) {
        const auto [giver, own] = owner_of_output(devices_, out);
        const Device& g = device(giver);
        bool waits = false;
        for (int j = 0; j < g.n_in; ++j)
          waits = waits || (feeds_through(g, own, j) && devices_.from[static_cast<std::size_t>(g.in + j)] >= 0);
        all.push_back({giver, waits, k - d.in, own});
      });
    }
    return all;
  }

  bool in_one_evaluation() {
    const auto n = devices_.all.size();
    std::vector<std::vector<Giver>> givers;
    for (int i = 0; i < count(); ++i) givers.push_back(givers_of(i));
    std::vector<bool> done(n, false);
    const auto open = [&](const Giver& g) { return !done[static_cast<std::size_t>(g.device)]; };
    while (devices_.order.size() < n) {
      int next = -1;
      std::ptrdiff_t early = 0;  // outputs that `next` would take before their devices are evaluated
      for (std::size_t i = 0; i < n; ++i) {
        if (done[i] || std::ranges::any_of(givers[i], [&](const Giver& g) { return g.waits && open(g); })) continue;
        const std::ptrdiff_t here = std::ranges::count_if(givers[i], open);
        if (next < 0 || here < early) next = static_cast<int>(i), early = here;
      }
      if (next < 0) return report_cycle(givers, done);
      for (const Giver& g : givers[static_cast<std::size_t>(next)])
        if (open(g) && std::ranges::find(devices_.first, g.device) == devices_.first.end()) devices_.first.push_back(g.device);
      done[static_cast<std::size_t>(next)] = true;
      devices_.order.push_back(next);
    }
    return true;
  }

  /// From any device that waits along who it waits for, until one comes again.
  bool report_cycle(const std::vector<std::vector<Giver>>& givers, const std::vector<bool>& done) const {
    std::vector<int> path = {static_cast<int>(std::ranges::find(done, false) - done.begin())};
    std::vector<std::string> links;  // from each of the path to the next
    while (true) {
      const auto& of = givers[static_cast<std::size_t>(path.back())];
      const Giver& g = *std::ranges::find_if(of, [&](const Giver& o) { return o.waits && !done[static_cast<std::size_t>(o.device)]; });
      const Device &taker = device(path.back()), &giver = device(g.device);
      links.push_back(fmt::format("{}.{} <- {}.{}", taker.name, input(taker, g.in), giver.name, output(giver, g.out)));
      const auto seen = std::ranges::find(path, g.device);
      if (seen == path.end()) {
        path.push_back(g.device);
        continue;
      }
      links.erase(links.begin(), links.begin() + (seen - path.begin()));
      return refuse(giver, "outputs that do not wait for each other in one evaluation", links, "a state in one of them (a lag)");
    }
  }

  /// The devices whose last ticks are in what an input reads now: those that give it, also by way of continuous ones.
  void sampled_behind(int in, const std::string& link, std::vector<Sampled>& all) const {
    devices_.each_source(in, [&](int out) {
      const auto [giver, own] = owner_of_output(devices_, out);
      const Device& g = device(giver);
      const std::string here = fmt::format("{} <- {}.{}", link, g.name, output(g, own));
      if (g.family->tick) all.push_back({giver, here});
      for (int k = 0; k < g.n_in; ++k)
        if (feeds_through(g, own, k)) sampled_behind(g.in + k, fmt::format("{}, {}.{}", here, g.name, input(g, k)), all);
    });
  }

  /// Of devices in one part of the ticks: before the controllers, or after.
  bool at_one_tick() const {
    std::vector<std::vector<Sampled>> behind(devices_.all.size());
    for (int i = 0; i < count(); ++i) {
      const Device& d = device(i);
      if (!d.family->tick) continue;
      std::vector<Sampled>& of = behind[static_cast<std::size_t>(i)];
      for (int k = 0; k < d.n_in; ++k) sampled_behind(d.in + k, fmt::format("{}.{}", d.name, input(d, k)), of);
      std::erase_if(of, [&](const Sampled& g) {  // its own last output is its memory
        const Device& other = device(g.device);
        return g.device == i || ticks_late(other) != ticks_late(d) || offset_of(other) != offset_of(d);
      });
    }
    enum State : char { fresh, on_the_way, done };
    std::vector<State> state(devices_.all.size(), fresh);
    std::vector<Sampled> way;
    const std::function<bool(int)> is_free = [&](int i) {
      state[static_cast<std::size_t>(i)] = on_the_way;
      for (const Sampled& g : behind[static_cast<std::size_t>(i)]) {
        way.push_back({i, g.link});
        const State there = state[static_cast<std::size_t>(g.device)];
        if (there == on_the_way) {
          std::vector<std::string> links;
          for (auto at = std::ranges::find(way, g.device, &Sampled::device); at != way.end(); ++at) links.push_back(at->link);
          return refuse(device(g.device), "devices that do not wait for each other at one tick", links, "an `offset` of one of them");
        }
        if (there == fresh && !is_free(g.device)) return false;
        way.pop_back();
      }
      state[static_cast<std::size_t>(i)] = done;
      return true;
    };
    for (int i = 0; i < count(); ++i)
      if (state[static_cast<std::size_t>(i)] == fresh && !is_free(i)) return false;
    return true;
  }

  const SystemSpec& spec_;
  Devices& devices_;
  DiagnosticSink& sink_;
};

}  // namespace

bool order_devices(const SystemSpec& spec, Devices& devices, DiagnosticSink& sink) { return DeviceOrder(spec, devices, sink).find(); }

std::pair<int, int> owner_of_output(const Devices& devices, int out) {
  int i = static_cast<int>(devices.all.size()) - 1;
  while (devices.all[static_cast<std::size_t>(i)].out > out) --i;
  return {i, out - devices.all[static_cast<std::size_t>(i)].out};
}

}  // namespace cardan
