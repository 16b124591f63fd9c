#pragma once
// How the modes of a flexible body are written in a vehicle (docs/scenario.md).
#include "bodies/modal/modal_source.hpp"
#include "core/model/schema.hpp"

namespace cardan {

/// Reads `modal: {...}` of a body. File names are relative to the folder of the file they stand in.
ModalSource read_modal_source(const DocRef& modal, ReadContext& context);

}  // namespace cardan
