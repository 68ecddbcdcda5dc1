// SPDX-License-Identifier: BSL-1.0
#include "pull_exchange.hpp"

#include "perf/support/localization.hpp"

#include <boost/asio/co_spawn.hpp>

#include <cstdint>
#include <stdexcept>
#include <utility>

namespace cles::perf {

namespace asio = boost::asio;

void register_localization(cles::registrar& tasks) {
    tasks.on_pull("localization", [served = std::uint64_t{0}]() mutable { return sample(served++); });
}

void serve_localization(std::string_view url, const run_options& how, const child_process::announce& announce) {
    asio::io_context io{1};
    cles::service car{io, {.name = "car1", .listen = {std::string{url}}}};
    register_localization(car);
    announce(car.endpoints().front());
    run(io, how);
}

const call_options pull_load::urgent_options = call_options{}.urgent();

pull_load::pull_load(asio::io_context& io, cles::service& client, std::string noun, handler_style style,
                     bool check_samples, run_options how)
    : io_(io), client_(client), noun_(std::move(noun)), style_(style), check_samples_(check_samples), how_(how) {}

std::chrono::nanoseconds pull_load::run(std::size_t in_flight, std::chrono::nanoseconds at_most,
                                        latency_recorder& record) {
    record.clear();
    record_ = &record;
    over_ = false;
    failure_ = nullptr;
    lanes_running_ = in_flight;
    lanes_.assign(in_flight, {});

    const auto began = clock::now();
    until_ = at_most == at_most.max() ? clock::time_point::max() : began + at_most;
    for (auto& each : lanes_) {
        each.began = began;
        if (style_ == handler_style::callback) {
            ask(each);
        } else {
            asio::co_spawn(io_, ask_on_and_on(began),
                           [this](std::exception_ptr failure) { lane_ended(std::move(failure)); });
        }
    }
    io_.restart();
    cles::run(io_, how_); // until the last lane has ended
    if (failure_) {
        const auto failure = failure_;
        client_.stop();
        io_.restart();
        io_.poll(); // so that no lane is called after this object is destroyed
        std::rethrow_exception(failure);
    }
    return last_ - began;
}

void pull_load::ask(lane& from) {
    auto done = [this, &from](boost::system::error_code code, const localization& value) {
        if (code) {
            lane_ended(std::make_exception_ptr(cles::error(code, "the PULL of " + noun_)));
        } else if (arrived(value, from.began)) {
            ask(from);
        } else {
            lane_ended(nullptr);
        }
    };
    if (urgent_ != nullptr) {
        client_.async_pull<localization>(noun_, *urgent_, std::move(done));
    } else {
        client_.async_pull<localization>(noun_, std::move(done));
    }
}

asio::awaitable<void> pull_load::ask_on_and_on(clock::time_point began) {
    for (;;) {
        localization value;
        if (urgent_ != nullptr) {
            value = co_await client_.async_pull<localization>(noun_, *urgent_);
        } else {
            value = co_await client_.async_pull<localization>(noun_);
        }
        if (!arrived(value, began)) {
            co_return;
        }
    }
}

bool pull_load::arrived(const localization& value, clock::time_point& began) {
    const auto now = clock::now();
    if (over_) {
        return false;
    }
    if (check_samples_ && !is_sample(value)) {
        failure_ = std::make_exception_ptr(std::runtime_error("the received values are not those that were sent"));
        over_ = true;
        return false;
    }
    last_ = now;
    record_->record(now - began);
    over_ = record_->full() || now >= until_;
    began = now; // the lane's next request starts where this one ended
    return !over_;
}

void pull_load::lane_ended(std::exception_ptr failure) {
    if (failure && !failure_) {
        failure_ = std::move(failure);
        over_ = true;
    }
    // After a failure, requests in flight may never be answered.
    if (--lanes_running_ == 0 || failure_) {
        io_.stop();
    }
}

} // namespace cles::perf
