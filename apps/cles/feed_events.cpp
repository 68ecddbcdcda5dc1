// SPDX-License-Identifier: BSL-1.0
#include "feed_events.hpp"

#include "diagnostics.hpp"

#include <string>

namespace tool {

void note_event(std::string_view noun, const cles::feed_item<cles::json_text>& item) {
    const std::string name{noun};
    switch (item.kind) {
    case cles::feed_event::gap:
        note(name + ": gap: " + std::to_string(item.missed) + (item.missed == 1 ? " update" : " updates") + " missed");
        break;
    case cles::feed_event::lost: note(name + ": lost: " + item.text + "; binding again"); break;
    case cles::feed_event::rebound: note(name + ": bound again"); break;
    case cles::feed_event::current:
    case cles::feed_event::update: break;
    }
}

} // namespace tool
