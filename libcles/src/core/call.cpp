// SPDX-License-Identifier: BSL-1.0
#include "core/call.hpp"

#include "core/inbound.hpp"
#include "core/node.hpp"
#include "core/result_text.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

call::call(std::shared_ptr<node> host, inbound& owner, terms wanted, time_point started)
    : node_(std::move(host)), owner_(&owner), terms_(std::move(wanted)), started_(started) {
    ++node_->counts.handlers_running;
}

call::~call() { --node_->counts.handlers_running; }

void call::done(std::string_view json) {
    if (owner_ != nullptr) {
        owner_->answer(*this, json);
    }
}

void call::fail(protocol::failure why) {
    if (owner_ != nullptr) {
        owner_->refuse(*this, why);
    }
}

bool call::progress(double fraction, std::string_view json) {
    if (owner_ == nullptr || !terms_.wants_progress || terms_.id == 0) {
        return false;
    }
    if (owner_->out_.is_behind()) {
        return true; // the next one tells more
    }
    reported_ = std::max(reported_, std::clamp(fraction, 0.0, 1.0));
    auto& out = terms_.urgent ? owner_->out_.urgent_output() : owner_->out_.output();
    const auto line = out.size();
    protocol::append_progress_head(out, terms_.id, reported_);
    const auto body = out.size();
    out.append(json);
    close_result(out, body);
    if (out.size() - line > owner_->replies_.longest()) { // the peer would close the link over it, or it does not fit
        out.replace(body, out.size() - body, "{}");
    }
    out.push_back('\n');
    owner_->out_.wake();
    return true;
}

void call::on_stop(std::function<void()> callback) {
    if (stopped_) {
        callback();
    } else if (owner_ != nullptr) {
        on_stop_ = std::move(callback);
    }
}

void call::stop() {
    stopped_ = true;
    if (const auto callback = std::exchange(on_stop_, nullptr)) {
        callback();
    }
}

void call::on_deadline(time_point) {
    const auto keep = shared_from_this();
    fail({.code = errc::deadline, .message = node_->name + " did not finish in time"});
    stop();
}

} // namespace cles::core
