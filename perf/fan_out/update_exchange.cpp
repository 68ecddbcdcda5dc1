// SPDX-License-Identifier: BSL-1.0
#include "update_exchange.hpp"

#include "feed_reader.hpp"
#include "perf/support/localization.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>

#include <algorithm>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

asio::awaitable<void> publish(cles::service& car, std::uint64_t updates) {
    for (std::uint64_t i = 0; i < updates; ++i) {
        co_await car.async_update("localization", sample(i));
    }
}

void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

/// What the binders of one run share.
class update_pass {
  public:
    update_pass(asio::io_context& io, cles::service& client, const update_load& load)
        : io_(io), client_(client), load_(load) {}

    [[nodiscard]] const update_load& load() const noexcept { return load_; }

    void bound() {
        if (++bound_ == load_.binders) {
            began_ = std::chrono::steady_clock::now();
            client_.async_push(
                "car1:publish", publish_order{load_.updates}, [this](boost::system::error_code code, const json_text&) {
                    if (code) {
                        fail(std::make_exception_ptr(cles::error(code, "the PUSH that starts the updates")));
                    }
                });
        }
    }

    void complete(std::uint64_t delivered, std::uint64_t missed) {
        tally_.delivered += delivered;
        tally_.missed += missed;
        if (++completed_ == load_.binders) {
            tally_.took = std::chrono::steady_clock::now() - began_;
            io_.stop();
        }
    }

    void fail(std::exception_ptr failure) {
        failure_ = std::move(failure);
        io_.stop();
    }

    [[nodiscard]] const std::exception_ptr& failure() const noexcept { return failure_; }
    [[nodiscard]] const update_tally& tally() const noexcept { return tally_; }

  private:
    asio::io_context& io_;
    cles::service& client_;
    const update_load& load_;
    std::size_t bound_ = 0;
    std::size_t completed_ = 0;
    std::chrono::steady_clock::time_point began_;
    update_tally tally_;
    std::exception_ptr failure_;
};

template <class T>
class update_binder : public feed_reader<update_binder<T>, T, update_pass> {
  public:
    explicit update_binder(update_pass& all)
        : feed_reader<update_binder, T, update_pass>(all, all.load().style, all.load().keep) {}

    /// False when the last update has arrived.
    bool take(const feed_item<T>& item) {
        if (item.kind == feed_event::lost) {
            throw std::runtime_error("the publisher was lost: " + item.text);
        }
        missed_ += item.missed;
        if (item.kind == feed_event::update) {
            if constexpr (std::is_same_v<T, localization>) {
                if (!is_sample(item.value)) {
                    throw std::runtime_error("the received values are not those that were published");
                }
            }
            // The gaps that the feed reports, checked against the numbers of the updates.
            if (last_seq_ != 0 && item.seq != last_seq_ + 1) {
                holes_ += item.seq - last_seq_ - 1;
            }
            last_seq_ = item.seq;
            ++delivered_;
        }
        const auto missed = std::max(missed_, holes_);
        auto& all = this->all_;
        if (delivered_ + missed < all.load().updates) {
            return true;
        }
        all.complete(delivered_, missed);
        return false;
    }

  private:
    std::uint64_t delivered_ = 0;
    std::uint64_t missed_ = 0;
    std::uint64_t holes_ = 0;
    std::uint64_t last_seq_ = 0;
};

template <class T>
update_tally take(asio::io_context& io, const std::vector<std::unique_ptr<cles::service>>& clients,
                  const update_load& load) {
    update_pass all{io, *clients.front(), load};
    std::vector<std::unique_ptr<update_binder<T>>> binders;
    for (std::size_t i = 0; i < load.binders; ++i) {
        binders.push_back(std::make_unique<update_binder<T>>(all));
        binders.back()->start(io, *clients[i]);
    }
    run_pass(io, load.how, all, clients, binders);
    return all.tally();
}

} // namespace

void serve_updates(std::string_view url, const run_options& how, const child_process::announce& announce) {
    asio::io_context io{1};
    cles::service car{io, {.name = "car1", .listen = {std::string{url}}}};
    car.on_bind("localization");
    car.on_push("publish",
                [&](const publish_order& order) { asio::co_spawn(io, publish(car, order.updates), rethrow); });
    announce(car.endpoints().front());
    run(io, how);
}

update_tally take_updates(asio::io_context& io, const std::vector<std::unique_ptr<cles::service>>& clients,
                          const update_load& load) {
    return load.form == value_form::raw ? take<json_text>(io, clients, load) : take<localization>(io, clients, load);
}

} // namespace cles::perf
