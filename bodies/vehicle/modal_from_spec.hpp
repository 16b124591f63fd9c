#pragma once
// From how the modes of a flexible body are written in a vehicle (docs/scenario.md) to the modes themselves.
#include "bodies/modal/mode_cache.hpp"
#include "bodies/modal/modal_source.hpp"
#include "core/model/schema.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// Reads `modal: {...}` of a body. File names are relative to the folder of the file they stand in.
ModalSource read_modal_source(const DocRef& modal, ReadContext& context);

/// Makes the modal data of each body that has a source and no data yet (equal sources are solved once), then checks
/// what needs them: node names and initial values. Throws InputError; what is doubtful goes to spec.warnings. Returns
/// the bodies whose modes came from the cache.
std::vector<std::string> make_modes(SystemSpec& spec, const ModeCache& cache = {});

}  // namespace cardan
