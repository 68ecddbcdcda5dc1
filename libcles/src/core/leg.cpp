// SPDX-License-Identifier: BSL-1.0
#include "core/leg.hpp"

#include <string>
#include <utility>

namespace cles::core {
namespace {

// What the words of a node that answers mean for the work: refused before it began, or not.
bool may_have_begun(const protocol::failure& why) {
    switch (why.code) {
    case errc::bad_request:
    case errc::denied:
    case errc::no_target:
    case errc::no_task:
    case errc::busy: return why.ran;
    default: return true;
    }
}

// A failure to get there, or of the way back.
leg_failure on_the_way(boost::system::error_code code, std::string_view message) {
    leg_failure why{.told = {.code = errc::unavailable, .message = std::string{message}}};
    if (code == errc::unavailable || code == errc::stopped) {
        return why;
    }
    if (code == errc::deadline || code == errc::too_large || code == errc::cancelled) {
        why.told.code = static_cast<errc>(code.value());
        why.begun = code != errc::too_large;
        return why;
    }
    if (code == errc::busy) { // this node's own word: it holds too much already
        why.told.code = errc::busy;
        why.begun = false;
        return why;
    }
    if (code == errc::no_target) {
        why.told.code = errc::no_target;
    }
    why.begun = false;
    why.unreachable = true;
    return why;
}

} // namespace

leg::verdict leg::offer(std::string_view json) {
    if (!detail::is_valid_answer(json)) {
        return verdict::malformed;
    }
    const std::unique_ptr<leg> self{this};
    to_->on_result(which_, json);
    return verdict::completed;
}

void leg::fail(boost::system::error_code code, std::string_view message) { end(on_the_way(code, message)); }

void leg::refuse(boost::system::error_code, std::string_view, std::string_view answer) {
    leg_failure why;
    protocol::parse_failure(answer, why.told);
    why.told.answer = answer;
    why.begun = may_have_begun(why.told);
    end(std::move(why));
}

void leg::end(leg_failure why) {
    const std::unique_ptr<leg> self{this};
    to_->on_failure(which_, std::move(why));
}

} // namespace cles::core
