// SPDX-License-Identifier: BSL-1.0
#include "daemon/start_trial.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/service.hpp>
#include <cles/url.hpp>

#include "config/config.hpp"
#include "daemon/service_parts.hpp"
#include "daemon/service_setup.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe/class.hpp>
#include <boost/system/errc.hpp>

#include <algorithm>
#include <chrono>
#include <exception>
#include <string>
#include <vector>

namespace cles::runtime {
namespace {

struct listener {
    std::string node;
};
BOOST_DESCRIBE_STRUCT(listener, (), (node))

// A service sends only while its context runs, except for its bridge to other pools, which connects at once.
void listen_and_join(const config& setup, const log_sink& log) {
    auto options = options_of(setup, log);
    options.federation = nullptr;
    boost::asio::io_context io{1};
    const service tried{io, options};
}

bool is_in_use(const error& e) { return e.code() == boost::system::errc::address_in_use; }

// Where it can be reached from this host: a socket that listens at all addresses replies over UDP from one of them.
std::string on_this_host(const std::string& where) {
    auto at = parse_url(where);
    if (at.host == "0.0.0.0" || at.host == "::") {
        at.host = at.host == "::" ? "::1" : "127.0.0.1";
    }
    return to_string(at);
}

bool listens_at(const config& setup, const std::string& where) {
    boost::asio::io_context io{1};
    service asking{io, {.name = setup.node, .security = security_of(setup)}};
    try {
        const auto reply =
            asking.request("PULL self:cles", call_options{}.at(on_this_host(where)).deadline(std::chrono::seconds{1}));
        return from_json<listener>(reply).node == setup.node;
    } catch (const std::exception&) { // it is another program, or a node that does not know this one
        return false;
    }
}

// Sealed datagrams need the name of another node, so what has such a port is not asked.
bool may_be_its_own(const config& setup, const std::string& where) {
    return (setup.security.is_on() && parse_url(where).scheme == "udp") || listens_at(setup, where);
}

bool is_url_in_use(config setup, const std::string& where) {
    setup.listen = {where};
    setup.multicast = {};
    try {
        listen_and_join(setup, {});
        return false;
    } catch (const error& e) {
        return is_in_use(e);
    }
}

} // namespace

bool try_start(const config& setup, const log_sink& log) {
    try {
        listen_and_join(setup, log);
        return false;
    } catch (const error& e) {
        const auto is_its_own = [&](const std::string& where) { return listens_at(setup, where); };
        if (!is_in_use(e) || std::ranges::none_of(setup.listen, is_its_own)) {
            throw;
        }
    }
    auto rest = setup;
    std::erase_if(rest.listen, [&](const std::string& where) {
        return is_url_in_use(setup, where) && may_be_its_own(setup, where);
    });
    listen_and_join(rest, log);
    return true;
}

} // namespace cles::runtime
