// SPDX-License-Identifier: BSL-1.0
#include <cles/peer.hpp>

namespace cles {

std::string_view to_string(peer_state state) noexcept {
    switch (state) {
    case peer_state::live: return "live";
    case peer_state::suspect: return "suspect";
    case peer_state::clash: return "clash";
    }
    return "";
}

} // namespace cles
