#include "scripts/commands/documents.hpp"

#include "core/base/embed.hpp"

CARDAN_EMBED(cardan::documents, errors, CARDAN_ERRORS_MD)
