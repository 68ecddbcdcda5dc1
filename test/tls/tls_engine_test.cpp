// SPDX-License-Identifier: BSL-1.0
#include "security/fleet_fixture.hpp"
#include "tls/raw_peer.hpp"
#include "tls/tls_engine.hpp"
#include "tls/tls_error.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tls_engine {
namespace {

using namespace cles::tls;
using namespace cles::tls::test;
using cles::security::test::key_of;
using engine_class = cles::tls::tls_engine;
using status = engine_class::status;
using role = engine_class::role;

// One end, its handshake and what it has read.
struct end {
    end(const tls_context& context, role as) : engine(context, as) {}

    void receive(std::string_view bytes) {
        while (!bytes.empty()) {
            const auto space = engine.prepare();
            const auto count = std::min(space.size(), bytes.size());
            std::copy_n(bytes.data(), count, space.data());
            engine.commit(count);
            bytes.remove_prefix(count);
            step();
        }
    }
    void step() {
        if (!established && state != status::failed) {
            state = engine.shake_hands(why);
            established = state == status::done;
        }
        if (established && state != status::failed && state != status::ended) {
            std::array<char, 4096> space{};
            std::size_t count = 0;
            while ((state = engine.read(space, count, why)) == status::done) {
                text.append(space.data(), count);
            }
        }
    }
    void say(std::string_view what) {
        boost::system::error_code failed;
        engine.write(what, failed);
        BOOST_TEST(!failed, failed.message());
    }
    std::string take_output() { return std::exchange(engine.encrypted(), {}); }

    engine_class engine;
    status state = status::need_input;
    bool established = false;
    std::string text{};
    boost::system::error_code why{};
};

struct fixture {
    tls_context near_context{key_of("near")};
    tls_context far_context{key_of("far")};
    end near{near_context, role::client};
    end far{far_context, role::server};

    // Delivers until neither end has output. `change` may alter what is under way.
    void exchange(const std::function<void(std::string&)>& change = [](std::string&) {}) {
        near.step();
        for (;;) {
            auto there = near.take_output();
            change(there);
            far.receive(there);
            auto back = far.take_output();
            change(back);
            near.receive(back);
            if (there.empty() && back.empty()) {
                return;
            }
        }
    }
    void connect() {
        exchange();
        BOOST_REQUIRE(near.established);
        BOOST_REQUIRE(far.established);
    }
};

// Runs a handshake with a peer that OpenSSL alone makes. Returns whether both ends have completed it.
bool shake_hands(end& own, raw_peer& peer) {
    bool peer_done = false;
    own.step();
    for (int i = 0; i < 10; ++i) {
        peer.receive(own.take_output());
        peer_done = peer.shake_hands();
        own.receive(peer.take_output());
    }
    return own.established && peer_done && own.state != status::failed;
}

// The first bytes of each record.
std::vector<std::size_t> records_of(std::string_view bytes) {
    std::vector<std::size_t> found;
    for (std::size_t at = 0; at + 5 <= bytes.size();) {
        found.push_back(at);
        at += 5 + static_cast<std::size_t>(static_cast<unsigned char>(bytes[at + 3])) * 256 +
              static_cast<unsigned char>(bytes[at + 4]);
    }
    return found;
}

} // namespace
} // namespace tls_engine

BOOST_FIXTURE_TEST_SUITE(tls_engine, fixture)

BOOST_AUTO_TEST_CASE(both_ends_learn_the_other_ends_key) {
    connect();
    BOOST_TEST((near.engine.peer_key() == key_of("far").public_part()));
    BOOST_TEST((far.engine.peer_key() == key_of("near").public_part()));
}

BOOST_AUTO_TEST_CASE(text_passes_in_both_directions) {
    connect();
    const std::string large(100'000, 'x');
    near.say("PULL self:cles\n");
    near.say(large);
    far.say("{}\n");
    exchange();
    BOOST_TEST((far.text == "PULL self:cles\n" + large));
    BOOST_TEST(near.text == "{}\n");
}

BOOST_AUTO_TEST_CASE(a_peer_that_has_ended_may_still_read) {
    connect();
    near.say("last\n");
    near.engine.finish();
    exchange();
    BOOST_TEST((far.state == status::ended));
    BOOST_TEST(far.text == "last\n");
    far.say("reply\n");
    near.receive(far.take_output());
    BOOST_TEST(near.text == "reply\n");
    far.engine.finish();
    near.receive(far.take_output());
    BOOST_TEST((near.state == status::ended));
}

BOOST_AUTO_TEST_CASE(nothing_is_encrypted_in_the_end_before_the_handshake_is_complete) {
    near.engine.finish();
    BOOST_TEST(near.take_output().empty());
}

BOOST_AUTO_TEST_CASE(no_session_is_resumed_and_there_are_no_tickets) {
    raw_peer client{true};
    BOOST_REQUIRE(shake_hands(far, client));
    char byte = 0;
    ::SSL_read(client.ssl(), &byte, 1); // would read a ticket
    BOOST_TEST(::SSL_SESSION_has_ticket(::SSL_get_session(client.ssl())) == 0);
    BOOST_TEST(::SSL_get_max_early_data(client.ssl()) == 0U);
    BOOST_TEST(std::string_view{::SSL_get_version(client.ssl())} == "TLSv1.3");
    BOOST_TEST(::SSL_get_negotiated_group(client.ssl()) == NID_X25519);
}

// -- peers that are refused ----------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(an_older_version_of_tls_is_refused) {
    for (const bool is_client : {true, false}) {
        end own{near_context, is_client ? role::server : role::client};
        raw_peer peer{is_client};
        ::SSL_CTX_set_max_proto_version(peer.context(), TLS1_2_VERSION);
        BOOST_TEST(!shake_hands(own, peer));
        BOOST_TEST((own.state == status::failed));
    }
}

BOOST_DATA_TEST_CASE_F(fixture, only_an_ed25519_certificate_is_accepted,
                       boost::unit_test::data::make({0, 1, 2, 3}) * boost::unit_test::data::make({true, false}), kind,
                       is_client) {
    end own{near_context, is_client ? role::server : role::client};
    raw_peer peer{is_client, static_cast<certificate>(kind)};
    const bool accepted = static_cast<certificate>(kind) == certificate::ed25519;
    BOOST_TEST(shake_hands(own, peer) == accepted);
    BOOST_TEST((own.state == status::failed) != accepted);
    BOOST_TEST(own.why.failed() != accepted);
}

BOOST_DATA_TEST_CASE_F(fixture, another_application_protocol_is_refused,
                       boost::unit_test::data::make({"", "\6cles/2", "\2h2"}) *
                           boost::unit_test::data::make({true, false}),
                       protocol, is_client) {
    end own{near_context, is_client ? role::server : role::client};
    raw_peer peer{is_client, certificate::ed25519, protocol};
    shake_hands(own, peer);
    BOOST_TEST(own.established == (!is_client && std::string_view{protocol}.size() > 1)); // it selects the one offered
    if (!own.established) {
        BOOST_TEST((own.state == status::failed));
    }
}

BOOST_AUTO_TEST_CASE(another_key_exchange_is_refused) {
    raw_peer client{true};
    ::SSL_CTX_set1_groups_list(client.context(), "P-256");
    BOOST_TEST(!shake_hands(far, client));
    BOOST_TEST((far.state == status::failed));
}

BOOST_DATA_TEST_CASE_F(fixture, what_is_not_tls_is_refused_with_an_alert,
                       boost::unit_test::data::make({"PULL self:cles reply=no\n", "GET / HTTP/1.1\r\n\r\n",
                                                     "\x16\x03\x01\xff\xff", "\x80\x01\x02\x03\x04\x05\x06\x07"}),
                       bytes) {
    far.receive(bytes);
    BOOST_TEST((far.state == status::failed));
    BOOST_TEST(far.why.message() != "");
}

// -- what happens to the bytes -------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_changed_byte_of_the_handshake_never_changes_a_key) {
    std::size_t total = 0;
    exchange([&](const std::string& bytes) { total += bytes.size(); });
    std::size_t completed = 0;
    for (std::size_t at = 0; at < total; at += 3) {
        fixture changed;
        std::size_t seen = 0;
        changed.exchange([&](std::string& bytes) {
            if (at >= seen && at < seen + bytes.size()) {
                bytes[at - seen] ^= static_cast<char>(1 << (at % 8));
            }
            seen += bytes.size();
        });
        if (changed.near.established && changed.far.established && changed.near.state != status::failed &&
            changed.far.state != status::failed) {
            ++completed; // such as the version in the head of the first record, which means nothing
            BOOST_TEST((changed.near.engine.peer_key() == key_of("far").public_part()));
            BOOST_TEST((changed.far.engine.peer_key() == key_of("near").public_part()));
        }
    }
    BOOST_TEST(total > 1000U);
    BOOST_TEST(completed < 20U);
}

BOOST_AUTO_TEST_CASE(a_changed_byte_of_a_record_is_noticed) {
    for (std::size_t at = 0;; ++at) {
        fixture f;
        f.connect();
        f.near.say("PUSH self:brake\n");
        auto bytes = f.near.take_output();
        if (at == bytes.size()) {
            break;
        }
        bytes[at] ^= 0x10;
        f.far.receive(bytes);
        BOOST_TEST(f.far.text.empty());
        BOOST_TEST((f.far.state == status::failed || at == 3 || at == 4)); // with another length, it waits for more
    }
}

BOOST_AUTO_TEST_CASE(a_repeated_omitted_or_moved_record_is_noticed) {
    const auto with = [](const std::function<std::string(const std::string&, const std::string&)>& order) {
        fixture f;
        f.connect();
        f.near.say("one\n");
        const auto one = f.near.take_output();
        f.near.say("two\n");
        const auto two = f.near.take_output();
        f.far.receive(order(one, two));
        BOOST_TEST((f.far.state == status::failed));
        return f.far.text;
    };
    BOOST_TEST(with([](const auto& one, const auto& two) { return one + one + two; }) == "one\n");
    BOOST_TEST(with([](const auto&, const auto& two) { return two; }) == "");
    BOOST_TEST(with([](const auto& one, const auto& two) { return two + one; }) == "");
}

BOOST_AUTO_TEST_CASE(a_repeated_connection_does_not_get_through) {
    std::string recorded;
    near.step();
    for (int i = 0; i < 4; ++i) {
        const auto there = near.take_output();
        recorded += there;
        far.receive(there);
        near.receive(far.take_output());
    }
    BOOST_REQUIRE(far.established);
    near.say("PUSH self:brake\n");
    recorded += near.take_output();

    end again{far_context, role::server};
    again.receive(recorded);
    BOOST_TEST(!again.established);
    BOOST_TEST(again.text.empty());
    BOOST_TEST((again.state == status::failed));
}

// An end of the stream is only what the peer has said: wherever the bytes stop, nothing has ended.
BOOST_AUTO_TEST_CASE(a_stream_that_stops_at_any_record_has_not_ended) {
    std::string there;
    near.step();
    for (int i = 0; i < 4; ++i) {
        there += near.engine.encrypted();
        far.receive(near.take_output());
        near.receive(far.take_output());
    }
    near.say("one\n");
    near.say("two\n");
    near.engine.finish();
    there += near.engine.encrypted();
    far.receive(near.take_output());
    BOOST_TEST((far.state == status::ended));
    const auto records = records_of(there);
    BOOST_TEST(records.size() >= 6U);
    // The keys differ with each connection, so each length needs one of its own.
    for (std::size_t stop = 0; stop < records.size(); ++stop) {
        fixture f;
        std::size_t passed = 0;
        f.near.step();
        const auto pass = [&] {
            std::string bytes = f.near.take_output();
            for (const auto at : records_of(bytes)) {
                const auto record = bytes.substr(
                    at, records_of(bytes.substr(at)).size() > 1 ? records_of(bytes.substr(at))[1] : std::string::npos);
                if (passed < stop) {
                    ++passed;
                    f.far.receive(record);
                }
            }
            f.near.receive(f.far.take_output());
        };
        for (int i = 0; i < 4; ++i) {
            pass();
        }
        if (f.near.established) {
            f.near.say("one\n");
            f.near.say("two\n");
            f.near.engine.finish();
            pass();
        }
        BOOST_TEST((f.far.state == status::need_input));
    }
}

BOOST_AUTO_TEST_CASE(the_bytes_may_arrive_one_at_a_time) {
    near.step();
    for (int i = 0; i < 4; ++i) {
        for (const char byte : near.take_output()) {
            far.receive({&byte, 1});
        }
        for (const char byte : far.take_output()) {
            near.receive({&byte, 1});
        }
    }
    BOOST_TEST(near.established);
    BOOST_TEST(far.established);
}

// -- limits --------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_peer_may_change_its_keys_but_not_all_the_time) {
    raw_peer client{true};
    BOOST_REQUIRE(shake_hands(far, client));
    const auto change_keys = [&] {
        ::SSL_key_update(client.ssl(), SSL_KEY_UPDATE_REQUESTED);
        ::SSL_write(client.ssl(), "x", 1);
        far.receive(client.take_output());
        client.receive(far.take_output());
        char byte = 0;
        ::SSL_read(client.ssl(), &byte, 1);
    };
    for (int i = 0; i < 8; ++i) {
        change_keys();
    }
    BOOST_TEST((far.state == status::need_input));
    BOOST_TEST(far.text == "xxxxxxxx");
    for (int i = 0; i < 20 && far.state != status::failed; ++i) {
        change_keys();
    }
    BOOST_TEST((far.state == status::failed));
    BOOST_TEST((far.why == tls_errc::too_many_keys));
}

BOOST_AUTO_TEST_CASE(a_certificate_that_is_too_large_is_refused) {
    raw_peer client{true};
    auto* chain = ::SSL_CTX_get0_certificate(client.context());
    for (int i = 0; i < 100; ++i) {
        ::SSL_CTX_add1_chain_cert(client.context(), chain);
    }
    BOOST_TEST(!shake_hands(far, client));
    BOOST_TEST((far.state == status::failed));
}

// OpenSSL keeps a key of each connection that was accepted, in memory that is locked and bounded.
BOOST_AUTO_TEST_CASE(thousands_of_connections_are_open_at_a_time) {
    connect();
    std::vector<std::unique_ptr<end>> open;
    for (int i = 0; i < 2'500; ++i) {
        auto& accepted = *open.emplace_back(std::make_unique<end>(far_context, role::server));
        end peer{near_context, role::client};
        peer.step();
        for (int j = 0; j < 3; ++j) {
            accepted.receive(peer.take_output());
            peer.receive(accepted.take_output());
        }
        BOOST_REQUIRE_MESSAGE(accepted.established && peer.established, i << ": " << accepted.why.message());
        accepted.engine.shrink();
    }
}

BOOST_AUTO_TEST_CASE(unused_memory_is_freed_and_comes_back) {
    connect();
    far.say(std::string(200'000, 'x'));
    exchange();
    BOOST_TEST(near.engine.buffered() > 34'000U);
    near.engine.shrink();
    far.engine.shrink();
    BOOST_TEST(near.engine.buffered() < 5'000U);
    BOOST_TEST(far.engine.buffered() < 5'000U);
    near.say("again\n");
    exchange();
    BOOST_TEST(far.text == "again\n");
}

BOOST_AUTO_TEST_CASE(a_peer_gets_long_turns_only_once_it_is_admitted) {
    connect();
    const auto longest_turn = [this] {
        near.say(std::string(400'000, 'x'));
        auto rest = near.take_output();
        std::size_t longest = 0;
        while (!rest.empty()) {
            const auto count = std::min(far.engine.prepare().size(), rest.size());
            longest = std::max(longest, count);
            far.receive(rest.substr(0, count));
            rest.erase(0, count);
        }
        return longest;
    };
    BOOST_TEST(longest_turn() == 16'384U);
    far.engine.admit();
    BOOST_TEST(longest_turn() == 65'536U);
    BOOST_TEST(far.text.size() == 800'000U);
}

BOOST_AUTO_TEST_CASE(before_its_handshake_it_costs_no_memory_of_openssl_and_sends_nothing) {
    end unused{far_context, role::server};
    BOOST_TEST(unused.engine.buffered() < 100U);
    boost::system::error_code why;
    unused.engine.write("text", why);
    BOOST_TEST((why == tls_errc::failed));
    unused.engine.finish();
    unused.engine.shrink();
    BOOST_TEST(unused.take_output().empty());
}

BOOST_AUTO_TEST_SUITE_END()
