from gym_server.api.watch_keys import KEY_SECONDS, WatchKeys


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def test_a_key_opens_one_page():
    keys = WatchKeys()
    key, other = keys.make("a"), keys.make("b")
    assert key != other
    assert keys.opens(key, "a") and not keys.opens(key, "b")
    assert keys.opens(other, "b") and not keys.opens("", "a")


def test_a_key_lasts_until_a_while_after_its_last_use():
    clock = Clock()
    keys = WatchKeys(clock)
    used, unused = keys.make("a"), keys.make("a")
    for _ in range(5):
        clock.now += KEY_SECONDS - 1
        assert keys.opens(used, "a")
    assert not keys.opens(unused, "a")
    clock.now += KEY_SECONDS + 1
    assert not keys.opens(used, "a")


def test_a_try_with_another_page_is_no_use():
    clock = Clock()
    keys = WatchKeys(clock)
    key = keys.make("a")
    clock.now = KEY_SECONDS - 1
    assert not keys.opens(key, "b")
    clock.now = KEY_SECONDS + 1
    assert not keys.opens(key, "a")


def test_keys_take_no_room_without_end():
    clock = Clock()
    keys = WatchKeys(clock)
    made = [keys.make("a") for _ in range(10_010)]
    assert len(keys._keys) == 10_000
    assert not keys.opens(made[0], "a") and keys.opens(made[-1], "a")
    clock.now = KEY_SECONDS + 1
    keys.make("a")
    assert len(keys._keys) == 1


def test_keys_are_not_kept_in_clear():
    keys = WatchKeys()
    assert keys.make("a") not in repr(vars(keys))
