#include "core/dynamics/batch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <span>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/model/loops.hpp"

namespace cardan {

struct Batch::Passes {
  virtual ~Passes() = default;
  virtual int width() const = 0;
  virtual std::size_t bytes() const = 0;
  virtual int forward(const BatchInputs& in, double* vdot, std::uint8_t* failed) = 0;
  virtual void inverse(const BatchInputs& in, double* tau) = 0;
  virtual bool mass_inverse(const double* q, int n, const double* f, double* out) = 0;
};

namespace {

using Two [[gnu::vector_size(16)]] = double;

/// to[i] lane l = from[l][i], `size` numbers of each of W states: in blocks of two by two.
template <class T>
void to_lanes(const double* const* from, int size, T* to) {
  constexpr int W = soa::kWidth<T>;
  auto* out = reinterpret_cast<double*>(to);
  int i = 0;
  if constexpr (W > 1)
    for (; i + 2 <= size; i += 2)
      for (int l = 0; l < W; l += 2) {
        Two a, b;
        std::memcpy(&a, from[l] + i, sizeof a), std::memcpy(&b, from[l + 1] + i, sizeof b);
        const Two low{a[0], b[0]}, high{a[1], b[1]};
        std::memcpy(out + W * i + l, &low, sizeof low), std::memcpy(out + W * (i + 1) + l, &high, sizeof high);
      }
  for (; i < size; ++i)
    for (int l = 0; l < W; ++l) out[W * i + l] = from[l][i];
}
/// And back, the first `count` lanes.
template <class T>
void from_lanes(const T* from, int size, int count, double* to) {
  constexpr int W = soa::kWidth<T>;
  const auto* in = reinterpret_cast<const double*>(from);
  int i = 0;
  if constexpr (W > 1)
    for (; i + 2 <= size && count == W; i += 2)
      for (int l = 0; l < W; l += 2) {
        Two a, b;
        std::memcpy(&a, in + W * i + l, sizeof a), std::memcpy(&b, in + W * (i + 1) + l, sizeof b);
        const Two low{a[0], b[0]}, high{a[1], b[1]};
        std::memcpy(to + l * size + i, &low, sizeof low), std::memcpy(to + (l + 1) * size + i, &high, sizeof high);
      }
  for (; i < size; ++i)
    for (int l = 0; l < count; ++l) to[l * size + i] = in[W * i + l];
}

template <class T>
class PassesOf : public Batch::Passes {
  static constexpr int W = soa::kWidth<T>;

 public:
  explicit PassesOf(const Model& model) : model_(model), ws_(model), out_(static_cast<std::size_t>(model.nv)) {
    q_.resize(static_cast<std::size_t>(model.nq));
    for (auto* column : {&v_, &tau_, &vdot_}) column->resize(static_cast<std::size_t>(model.nv));
  }
  int width() const override { return W; }
  std::size_t bytes() const override { return ws_.bytes() + (q_.size() + 4 * v_.size()) * sizeof(T); }

  int forward(const BatchInputs& all, double* vdot, std::uint8_t* failed) override {
    articulated_.clear();
    BatchInputs in = all;
    if (!model_.has_prescribed()) in.vdot = nullptr;  // nobody would look
    int failures = 0;
    const auto mark = [&](int k, bool bad) {
      if (failed) failed[k] = bad;
      if (!bad) return;
      ++failures;
      std::fill_n(vdot + static_cast<std::ptrdiff_t>(k) * model_.nv, model_.nv, std::numeric_limits<double>::quiet_NaN());
    };
    for (int first = 0; first < in.n; first += W) {
      const int count = std::min(W, in.n - first);
      const soa::Inputs<T> lanes = load(in, first, count);
      if (forward_dynamics<T>(model_, ws_, lanes, out_.data())) {
        store(first, count, vdot);
        for (int k = first; k < first + count; ++k) mark(k, false);
        continue;
      }
      for (int k = first; k < first + count; ++k) {  // one of them has no inertia somewhere: each by itself, in all lanes
        const bool good = forward_dynamics<T>(model_, ws_, load(in, k, 1), out_.data());
        if (good) store(k, 1, vdot);
        mark(k, !good);
      }
    }
    return failures;
  }

  void inverse(const BatchInputs& all, double* tau) override {
    articulated_.clear();
    BatchInputs in = all;
    in.tau = nullptr;
    for (int first = 0; first < in.n; first += W) {
      const int count = std::min(W, in.n - first);
      inverse_dynamics<T>(model_, ws_, load(in, first, count), out_.data());
      store(first, count, tau);
    }
  }

  bool mass_inverse(const double* q, int n, const double* f, double* out) override {
    const soa::Sweeps<T>& S = soa::sweeps<T>();
    std::transform(q, q + model_.nq, q_.begin(), [](double x) { return T(x); });
    for (auto* column : {&v_, &vdot_}) std::fill(column->begin(), column->end(), T(0));
    const soa::Inputs<T> in{.q = q_.data(), .v = v_.data(), .tau = tau_.data(), .vdot = vdot_.data(), .gravity = false};
    bool again = std::ranges::equal(articulated_, std::span(q, static_cast<std::size_t>(model_.nq)));
    articulated_.clear();
    for (int first = 0; first < n; first += W) {
      const int count = std::min(W, n - first);
      fill(f, model_.nv, first, count, tau_);
      if (again) {
        S.ground(model_, ws_, in);
        S.at_rest(model_, ws_);
      } else {
        outward(model_, S, ws_, in, {.velocity = false});
      }
      for (auto run = model_.runs.rbegin(); run != model_.runs.rend(); ++run) {
        S.inward(model_, ws_, in, *run, {.inertia = !again});
        if (ws_.breakdown.body != 0) return false;
      }
      again = true;
      for (const Run& run : model_.runs) S.acceleration(model_, ws_, in, run, out_.data());
      store(first, count, out);
    }
    articulated_.assign(q, q + model_.nq);
    return true;
  }

 private:
  /// Columns first ... first + count - 1 of `size` numbers into the lanes; the first of them once more in the lanes that are left.
  static void fill(const double* from, int size, int first, int count, std::vector<T>& to) {
    const double* columns[W];
    for (int l = 0; l < W; ++l) columns[l] = from + static_cast<std::ptrdiff_t>(first + (l < count ? l : 0)) * size;
    to_lanes(columns, size, to.data());
  }
  soa::Inputs<T> load(const BatchInputs& in, int first, int count) {
    soa::Inputs<T> lanes;
    lanes.gravity = in.gravity;
    lanes.moment = in.moment;
    const auto taken = [&](const double* from, int size, std::vector<T>& to) -> const T* {
      if (!from) return nullptr;
      fill(from, size, first, count, to);
      return to.data();
    };
    lanes.q = taken(in.q, model_.nq, q_);
    if (!in.v) std::fill(v_.begin(), v_.end(), T(0));
    lanes.v = in.v ? taken(in.v, model_.nv, v_) : v_.data();
    lanes.tau = taken(in.tau, model_.nv, tau_);
    lanes.vdot = taken(in.vdot, model_.nv, vdot_);
    if (!lanes.vdot && model_.has_prescribed()) {
      std::fill(vdot_.begin(), vdot_.end(), T(0));
      lanes.vdot = vdot_.data();
    }
    return lanes;
  }
  void store(int first, int count, double* to) const {
    from_lanes(out_.data(), model_.nv, count, to + static_cast<std::ptrdiff_t>(first) * model_.nv);
  }

  const Model& model_;
  soa::Workspace<T> ws_;
  std::vector<T> q_, v_, tau_, vdot_, out_;
  std::vector<double> articulated_;  // P, D and G in the workspace are those of this q; empty: of none
};

/// A device that pushes or carries mass; null: there is none.
const Device* in_the_way(const Model& model) {
  for (const Device& d : model.devices.all)
    for (const DeviceMount& m : d.mounts)
      if ((m.use & CARDAN_USE_LOAD) != 0 || (d.family->mass && m.node >= 0)) return &d;
  return nullptr;
}

}  // namespace

bool Batch::takes(const Model& model) { return !in_the_way(model); }
Batch::Batch(const Model& model) {
  require_open_tree(model, "batches of states");
  if (const Device* d = in_the_way(model))
    refuse(Code::unsupported, {"a batch of states"}, "a model without devices that push or carry mass",
           fmt::format("device {} ({})", d->name, d->family->type), "forward_dynamics() state by state, with its DeviceForces");
  if (soa::instruction_set().eight.outward)
    passes_ = std::make_unique<PassesOf<soa::Lanes<8>>>(model);
  else if (soa::instruction_set().four.outward)
    passes_ = std::make_unique<PassesOf<soa::Lanes<4>>>(model);
  else
    passes_ = std::make_unique<PassesOf<soa::Lanes<2>>>(model);
}
Batch::~Batch() = default;
Batch::Batch(Batch&&) noexcept = default;

int Batch::width() const { return passes_->width(); }
std::size_t Batch::bytes() const { return passes_->bytes(); }
int Batch::forward_dynamics(const BatchInputs& in, double* vdot, std::uint8_t* failed) { return passes_->forward(in, vdot, failed); }
void Batch::inverse_dynamics(const BatchInputs& in, double* tau) { passes_->inverse(in, tau); }
bool Batch::mass_inverse(const double* q, int n, const double* f, double* out) { return passes_->mass_inverse(q, n, f, out); }

}  // namespace cardan
