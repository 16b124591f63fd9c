#pragma once
// A vehicle in YAML (docs/scenario.md), ready for compile().
#include <memory>
#include <string>
#include <vector>

#include "bodies/modal/mode_cache.hpp"
#include "core/abi/registry.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// Reads the file, sets what `overrides` say (key path inside the vehicle and value: {"bodies.bus.mass", "1700 kg"}), makes the modes of
/// its flexible bodies, and checks everything. Throws InputError with all that is wrong; what is doubtful is in SystemSpec::warnings.
std::shared_ptr<const SystemSpec> load_vehicle(const std::string& path, const Registry& registry, const Overrides& overrides = {});

/// Modal data of `made` for each body whose source is the same.
void take_modes(SystemSpec& spec, const SystemSpec& made);

/// The second half of it: the modal data of each body that has a source and no data yet (equal sources are solved once), then the
/// checks that need them: node names and initial values. Throws InputError. Returns the bodies whose modes came from the cache.
std::vector<std::string> make_modes(SystemSpec& spec, const ModeCache& cache = {});

}  // namespace cardan
