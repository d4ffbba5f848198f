import hmac
import os

import pytest
from front_process import write_users

from gym_server.front.users_file import UsersFile, read_users
from gym_server.tokens import CannotStartError

ANNA, BEN = "a" * 16, "b" * 1024


@pytest.fixture
def file(tmp_path):
    return tmp_path / "users"


def test_a_token_names_its_user(file):
    file.write_text(f"# a class\n\nanna {ANNA}\n  ben\t{BEN}  \n")
    file.chmod(0o600)
    users = UsersFile(file)
    assert [user.name for user in users.users] == ["anna", "ben"]
    assert users.find(ANNA.encode()).name == "anna"
    assert users.find(BEN.encode()).name == "ben"
    for wrong in (b"", ANNA[1:].encode(), ANNA.encode() + b"a", b"\xff" * 16):
        assert users.find(wrong) is None


def test_the_token_is_compared_with_that_of_every_user_in_constant_time(file, monkeypatch):
    users = UsersFile(write_users(file, anna=ANNA, ben=BEN))
    compared = []
    compare_digest = hmac.compare_digest

    def compare(one, other):
        compared.append((len(one), len(other)))
        return compare_digest(one, other)

    monkeypatch.setattr(hmac, "compare_digest", compare)
    for token in (ANNA.encode(), BEN.encode(), b"wrong"):
        compared.clear()
        users.find(token)
        assert compared == [(32, 32)] * 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no user"),
        ("# nobody\n\n", "has no user"),
        ("anna\n", "line 1 of .* has no token"),
        (f"anna {ANNA} more\n", "more than a name and a token"),
        (f"anna {ANNA}\nben short\n", "line 2 of .* it has 5; 'openssl rand -hex 16'"),
        (f"anna {BEN}b\n", "it has more"),
        ("anna " + "ä" * 16, "other characters"),
        (f"../anna {ANNA}\n", "must begin with a name"),
        (f"{'x' * 33} {ANNA}\n", "must begin with a name"),
        (f"anna {ANNA}\n\nAnna {BEN}\n", "line 3 of .* has a name again"),
        (f"anna {ANNA}\nben {ANNA}\n", "line 2 of .* has a token again"),
    ],
)
def test_what_is_no_users_file_is_refused_without_a_word_of_it(file, text, words):
    file.write_text(text)
    file.chmod(0o600)
    with pytest.raises(CannotStartError, match=words) as caught:
        read_users(file)
    message = str(caught.value).replace(str(file), "")
    for word in text.split():
        assert len(word) < 4 or word in ("more", "anna", "short") or word not in message
    assert "short" not in message and "\n" not in message


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_file_that_others_can_read_is_refused_with_the_fix(file, mode):
    write_users(file, mode=mode, anna=ANNA)
    with pytest.raises(CannotStartError, match=f"'chmod 600 {file}'"):
        read_users(file)


def test_a_file_that_cannot_be_read_is_refused(file):
    with pytest.raises(CannotStartError, match="No such file"):
        read_users(file)
    file.write_bytes(b"anna \xff")
    file.chmod(0o600)
    with pytest.raises(CannotStartError, match="UTF-8"):
        read_users(file)


def test_it_is_read_again_when_it_changes_and_a_fault_changes_nothing(file, caplog):
    users = UsersFile(write_users(file, anna=ANNA))
    assert not users.read_again()
    write_users(file, anna=ANNA, ben=BEN)
    assert users.read_again() and len(users.users) == 2
    os.utime(file, (1, 1))
    assert not users.read_again()
    write_users(file, anna="short")
    assert not users.read_again() and not users.read_again()
    assert len(users.users) == 2
    assert caplog.text.count("The users stay as they were") == 1 and "short" not in caplog.text
