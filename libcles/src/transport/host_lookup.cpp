// SPDX-License-Identifier: BSL-1.0
#include "transport/host_lookup.hpp"

#include "transport/ip_host.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

void host_lookup::start(const url& where, std::chrono::milliseconds within, callback done) {
    done_ = std::move(done);
    if (const auto literal = literal_address(where)) {
        asio::post(resolver_.get_executor(),
                   [self = shared_from_this(), address = *literal] { self->end({}, {address}); });
        return;
    }
    patience_.expires_after(within);
    patience_.async_wait([self = shared_from_this()](error_code code) {
        if (!code) {
            self->end(asio::error::timed_out, {});
        }
    });
    resolver_.async_resolve(where.host, "",
                            [self = shared_from_this()](error_code code, asio::ip::tcp::resolver::results_type found) {
                                self->end(code, addresses_of(found));
                            });
}

void host_lookup::end(error_code code, const std::vector<asio::ip::address>& found) {
    const auto done = std::move(done_);
    give_up();
    if (done) {
        done(!code && found.empty() ? asio::error::host_not_found : code, found);
    }
}

void host_lookup::give_up() {
    done_ = nullptr;
    resolver_.cancel();
    patience_.cancel();
}

} // namespace cles::transport
