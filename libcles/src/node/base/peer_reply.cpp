// SPDX-License-Identifier: BSL-1.0
#include "node/base/peer_reply.hpp"

#include <memory>

namespace cles::core {

peer_reply::verdict peer_reply::offer(std::string_view json) {
    if (checks_json_ && !detail::is_valid_answer(json)) {
        return verdict::malformed;
    }
    finish({.json = json});
    return verdict::completed;
}

void peer_reply::fail(boost::system::error_code code, std::string_view message) {
    finish({.code = code, .message = message});
}

void peer_reply::refuse(boost::system::error_code code, std::string_view message, std::string_view answer) {
    finish({.code = code, .message = message, .refusal = answer});
}

void peer_reply::finish(const peer_answer& found) {
    const std::unique_ptr<peer_reply> self{this};
    then_(found);
}

} // namespace cles::core
