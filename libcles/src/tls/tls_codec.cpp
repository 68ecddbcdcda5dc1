// SPDX-License-Identifier: BSL-1.0
#include "tls/tls_codec.hpp"

#include "tls/tls_error.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace cles::tls {
namespace {

using admission = security::link_admission;

tls_errc code_of(admission::reason why) noexcept {
    switch (why) {
    case admission::reason::none: break;
    case admission::reason::protocol: return tls_errc::bad_admission;
    case admission::reason::not_member: return tls_errc::not_member;
    case admission::reason::other_name: return tls_errc::other_name;
    case admission::reason::by_peer: return tls_errc::refused_by_peer;
    case admission::reason::busy: return tls_errc::busy;
    }
    return tls_errc::failed;
}

} // namespace

tls_codec::tls_codec(std::shared_ptr<const tls_context> shared, tls_engine::role as,
                     std::shared_ptr<security::admission_terms> terms, std::string expected, report_function report,
                     std::chrono::milliseconds time_to_open)
    : shared_(std::move(shared)), terms_(std::move(terms)), report_(std::move(report)), time_to_open_(time_to_open),
      engine_(*shared_, as), admission_(terms_, std::move(expected)) {}

tls_codec::status tls_codec::open(boost::system::error_code& why) {
    if (shaken_) {
        return admit(why);
    }
    switch (engine_.shake_hands(why)) {
    case tls_engine::status::done: break;
    case tls_engine::status::need_input: return status::need_input;
    case tls_engine::status::ended: why = tls_errc::failed; [[fallthrough]];
    case tls_engine::status::failed: return status::failed;
    }
    shaken_ = true;
    lines_.emplace(admission_.max_line());
    std::string first;
    admission_.begin(engine_.peer_key(), first);
    engine_.write(first, why);
    return why ? status::failed : admit(why);
}

tls_codec::status tls_codec::admit(boost::system::error_code& why) {
    for (;;) {
        std::string_view line;
        lines_->set_limit(admission_.max_line());
        switch (lines_->next(line)) {
        case protocol::line_buffer::status::line: // valid for as long as `lines_` is
            if (const auto result = take_line(line, why); result != status::need_input) {
                return result;
            }
            continue;
        case protocol::line_buffer::status::overlong: why = tls_errc::bad_admission; return status::failed;
        case protocol::line_buffer::status::need_more: break;
        }
        std::size_t count = 0;
        switch (engine_.read(lines_->prepare(), count, why)) {
        case tls_engine::status::done: lines_->commit(count); break;
        case tls_engine::status::need_input: return status::need_input;
        case tls_engine::status::ended: why = tls_errc::bad_admission; [[fallthrough]];
        case tls_engine::status::failed: return status::failed;
        }
    }
}

tls_codec::status tls_codec::take_line(std::string_view line, boost::system::error_code& why) {
    std::string reply;
    const auto verdict = admission_.on_line(line, reply);
    boost::system::error_code unsent;
    engine_.write(reply, unsent);
    switch (verdict) {
    case admission::verdict::pending: why = unsent; return unsent ? status::failed : status::need_input;
    case admission::verdict::admitted:
        rest_ = lines_->unfinished();
        lines_.reset();
        return status::done;
    case admission::verdict::refused: break;
    }
    why = code_of(admission_.refused_for());
    if (report_) {
        report_(admission_.why());
    }
    return status::failed;
}

void tls_codec::watch(std::function<void(boost::system::error_code)> broken) {
    observation_ = terms_->fleet->observe([this, broken = std::move(broken)](const security::roster&) {
        if (!removed_ && !admission_.is_in_force()) {
            removed_ = true;
            broken(tls_errc::removed);
        }
    });
}

tls_codec::status tls_codec::decode(std::span<char> space, std::size_t& count, boost::system::error_code& why) {
    if (removed_) {
        why = tls_errc::removed;
        return status::failed;
    }
    if (!rest_.empty()) {
        count = std::min(space.size(), rest_.size());
        std::memcpy(space.data(), rest_.data(), count);
        rest_.erase(0, count);
        return status::done;
    }
    switch (engine_.read(space, count, why)) {
    case tls_engine::status::done: return status::done;
    case tls_engine::status::need_input: return status::need_input;
    case tls_engine::status::ended: return status::ended;
    case tls_engine::status::failed: break;
    }
    return status::failed;
}

void tls_codec::encode(std::string_view text, boost::system::error_code& why) {
    if (removed_) {
        why = tls_errc::removed;
    } else {
        engine_.write(text, why);
    }
}

std::size_t tls_codec::buffered() const noexcept { return engine_.buffered() + (lines_ ? lines_->capacity() : 0); }

} // namespace cles::tls
