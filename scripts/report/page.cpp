#include "scripts/report/page.hpp"

#include "core/base/embed.hpp"

CARDAN_EMBED(cardan::page, html, CARDAN_TEMPLATE)
CARDAN_EMBED(cardan::page, style, CARDAN_BUNDLE ".css")
CARDAN_EMBED(cardan::page, script, CARDAN_BUNDLE ".js")
CARDAN_EMBED(cardan::page, notice, CARDAN_NOTICE)
