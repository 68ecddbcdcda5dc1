// SPDX-License-Identifier: BSL-1.0
#include "delegate_load.hpp"

#include <utility>

namespace cles::perf {

delegate_load::delegate_load(boost::asio::io_context& io, cles::service& client, std::string noun,
                             const run_options& how)
    : io_(io), client_(client), noun_(std::move(noun)), how_(how) {}

std::chrono::nanoseconds delegate_load::run(std::size_t in_flight, latency_recorder& record) {
    record_ = &record;
    to_send_ = record.remaining();
    begun_.assign(in_flight, {});
    const auto began = clock::now();
    for (auto& lane : begun_) {
        ask(lane);
    }
    io_.restart();
    cles::run(io_, how_);
    if (failure_) {
        throw cles::error(failure_, "the DELEGATE of " + noun_);
    }
    return clock::now() - began;
}

void delegate_load::ask(clock::time_point& begun) {
    if (to_send_ == 0) {
        return;
    }
    --to_send_;
    ++open_;
    begun = clock::now();
    client_.async_delegate(noun_, json_text{"{}"}, [this, &begun](boost::system::error_code code, const json_text&) {
        --open_;
        if (code) {
            failure_ = code;
            to_send_ = 0;
        } else {
            record_->record(clock::now() - begun);
            ask(begun);
        }
        if (open_ == 0) {
            io_.stop();
        }
    });
}

} // namespace cles::perf
