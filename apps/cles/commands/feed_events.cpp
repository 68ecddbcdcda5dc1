// SPDX-License-Identifier: BSL-1.0
#include "commands/feed_events.hpp"

#include "output/diagnostics.hpp"

#include <algorithm>
#include <string>

namespace tool {

void note_event(std::string_view noun, const cles::feed_item<cles::json_text>& item) {
    // Of `all:`, whose update it was that is missing.
    const auto task = noun.substr(std::min(noun.find(':'), noun.size()));
    const std::string name =
        noun.starts_with("all:") && !item.publisher.empty() ? item.publisher + std::string{task} : std::string{noun};
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
