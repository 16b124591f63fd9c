#pragma once
// What the executable laws of every kind of family share: a list of violations, arrays with guards around them, random parameters.
#include <fmt/format.h>

#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/abi/param_values.hpp"
#include "core/abi/table_checks.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// Violations of laws, each with its error, its limit and the sample.
class Violations {
 public:
  int sample = 0;

  /// `scale` is the size of what was subtracted, so that the limit is one of relative precision.
  void law(const char* name, double error, double limit, double scale = 0.0) {
    error /= 1.0 + scale;
    if (!(error <= limit)) found_.push_back(fmt::format("{}: error {:.2g} (limit {:.0e}, sample {})", name, error, limit, sample));
  }
  /// A law that holds or does not.
  void law(const char* name, bool holds) {
    if (!holds) found_.push_back(fmt::format("{} (sample {})", name, sample));
  }
  void add(std::string text) { found_.push_back(std::move(text)); }
  bool none() const { return found_.empty(); }
  std::vector<std::string> take() { return std::move(found_); }

 private:
  std::vector<std::string> found_;
};

/// n numbers that foreign code is handed to write into: no numbers before the call, guards on both sides.
class Handed {
 public:
  explicit Handed(std::size_t n) : all_(n + 2 * kGuard, std::numeric_limits<double>::quiet_NaN()), n_(n) {
    std::memset(all_.data(), kMark, kGuard * sizeof(double));
    std::memset(all_.data() + kGuard + n, kMark, kGuard * sizeof(double));
  }
  double* data() { return all_.data() + kGuard; }
  const double* data() const { return all_.data() + kGuard; }
  bool intact() const {
    const auto marked = [&](std::size_t from) {
      const auto* bytes = reinterpret_cast<const unsigned char*>(all_.data() + from);
      for (std::size_t i = 0; i < kGuard * sizeof(double); ++i)
        if (bytes[i] != kMark) return false;
      return true;
    };
    return marked(0) && marked(kGuard + n_);
  }
  Eigen::Map<const Eigen::VectorXd> vector() const { return {data(), static_cast<Eigen::Index>(n_)}; }

 private:
  static constexpr std::size_t kGuard = 64;
  static constexpr unsigned char kMark = 0xA5;
  std::vector<double> all_;
  std::size_t n_;
};

/// n numbers between -1 and 1.
Eigen::VectorXd random_vector(std::mt19937_64& rng, Eigen::Index n);

/// A set of parameters inside of their ranges (between 0.3 and 1 where there is none). `orthonormal`: lists of up to three vectors
/// are. `sparse`: what has a fallback takes it.
ParamTable random_parameters(std::span<const cardan_param_desc> schema, std::mt19937_64& rng, bool orthonormal, bool sparse);

/// An instance packed at random: by random parameters, with orthonormal vectors, or as sparse as may be; the first set that pack accepts.
struct PackedSample {
  std::vector<double> block;
  std::size_t bytes = 0;
  std::string fault;  // it wrote beyond its bytes, or wants too many
};
/// `size` tells the bytes, `pack` fills them. Empty block: every set was refused.
PackedSample packed_at_random(std::span<const cardan_param_desc> schema, std::uint64_t seed,
                              const std::function<std::uint64_t(const cardan_param_values*)>& size,
                              const std::function<int(const cardan_param_values*, void*)>& pack);

/// Of a family whose pack may be null and whose size need not depend on the parameters; `before` is told what is called.
template <class Family>
PackedSample packed_at_random(const Family& f, std::uint64_t seed, const TellPhase& before) {
  PackedSample packed = packed_at_random(
      {f.params, f.n_params}, seed,
      [&](const cardan_param_values* values) {
        before("packed_size");
        return f.packed_size ? f.packed_size(values) : f.params_size;
      },
      [&](const cardan_param_values* values, void* to) {
        before("pack");
        return f.pack ? f.pack(values, to) : 0;
      });
  if (packed.block.empty() && packed.fault.empty()) packed.fault = "pack refuses every set of random parameters";
  return packed;
}

/// The same call in another thread.
void in_another_thread(const std::function<void()>& call);

}  // namespace cardan
