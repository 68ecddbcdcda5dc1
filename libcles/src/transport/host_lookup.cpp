// SPDX-License-Identifier: BSL-1.0
#include "transport/host_lookup.hpp"

#include "transport/address_race.hpp"
#include "transport/ip_host.hpp"
#include "transport/lookup_error.hpp"
#include "transport/lookup_threads.hpp"
#include "transport/member_handler.hpp"

#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

host_lookup::host_lookup(const asio::any_io_executor& executor, url where, std::shared_ptr<lookup_threads> threads)
    : executor_(executor), timeout_(executor), where_(std::move(where)), threads_(std::move(threads)) {}

void host_lookup::start(std::chrono::milliseconds within, callback done) {
    done_ = std::move(done);
    if (const auto literal = literal_address(where_)) {
        outcome_.found = {*literal};
        post_call<&host_lookup::on_outcome>(executor_, shared_from_this());
        return;
    }
    place_ = where_.scheme + "://" + where_.host + ':' + std::to_string(where_.port);
    timeout_.expires_after(within);
    wait_call<&host_lookup::on_timeout>(timeout_, shared_from_this());
    if (!threads_) {
        threads_ = lookup_threads::of(executor_);
    }
    asked_ = true;
    threads_->start(shared_from_this(), executor_, where_.host);
}

void host_lookup::on_timeout(error_code code) {
    if (!code) {
        end(lookup_errc::timed_out, {});
    }
}

void host_lookup::on_outcome() {
    const auto& found = outcome_.found;
    const auto preferred = asked_ && found.size() > 1 ? threads_->preferred(place_) : std::nullopt;
    end(outcome_.code, found.empty() ? found : in_connection_order(found, preferred));
}

void host_lookup::end(error_code code, const std::vector<asio::ip::address>& found) {
    const auto done = std::move(done_);
    give_up();
    if (done) {
        done(code, found);
    }
}

void host_lookup::give_up() {
    done_ = nullptr;
    timeout_.cancel();
    if (asked_) {
        threads_->forget(where_.host, ticket_);
    }
}

void host_lookup::prefer(const asio::ip::address& answered) {
    if (asked_) { // else there is only one
        threads_->prefer(place_, answered);
    }
}

} // namespace cles::transport
