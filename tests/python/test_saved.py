"""Saved worlds: what is committed is there again, and a picture is that of the world with the same edits."""
import pytest

import karst
from conftest import SMALL


def test_edits_are_kept(tmp_path, hills):
    file = tmp_path / "mine.karstdb"
    with karst.Saved.create(file, karst.World("hills", parameters={"relief": 300}, seed=3)) as saved:
        saved.append([karst.Edit.sphere((0, 300, 0), 9), "box,5,300,0,1,2,3,remove"])
        saved.camera = karst.Camera(0, 400, 0, yaw=30)
        saved.set_bookmark(2, "1,2,3,4,5")
        assert saved.undo() == 1 and saved.num_edits == (1, 1) and saved.redo() == 1
    saved = karst.Saved(file, for_writing=False)
    assert [one["shape"] for one in saved.edits] == ["sphere", "box"] and saved.num_edits == (2, 0)
    assert saved.camera.yaw == 30 and saved.bookmarks[2].pitch == 5 and saved.bookmarks[0] is None
    world = saved.world()
    assert world.seed == 3 and world.parameters["relief"].value == 300 and saved.parameters == {"relief": 300}
    assert world.density([[0, 300, 0]], edits=saved.edits) > 0
    assert saved.check() == []
    with pytest.raises(karst.Error):
        saved.append("sphere,0,0,0,1")


def test_what_is_not_committed_is_gone(tmp_path):
    file = tmp_path / "mine.karstdb"
    with pytest.raises(KeyError):
        with karst.Saved.create(file, "hills") as saved:
            saved.append("sphere,0,0,0,1")
            raise KeyError
    assert len(karst.Saved(file).edits) == 0


def test_a_text_travels_inside(tmp_path):
    with karst.Saved.create(tmp_path / "ball.karstdb", karst.World("float density(vec3 p) { return 5.0 - length(p); }")):
        pass
    assert karst.Saved(tmp_path / "ball.karstdb").world().density([[0, 0, 0]]) == 5


def test_copies(tmp_path):
    file = tmp_path / "mine.karstdb"
    with karst.Saved.create(file, "hills") as saved:
        saved.append("sphere,0,0,0,1")
        saved.commit()
        saved.backup(tmp_path / "copy.karstdb")
        saved.compact()
    assert len(karst.Saved(tmp_path / "copy.karstdb").edits) == 1
    assert karst.Saved.recover(file, tmp_path / "new.karstdb") == []
    assert len(karst.Saved(tmp_path / "new.karstdb").edits) == 1
    with pytest.raises(karst.Error, match="there already"):
        karst.Saved.create(file, "hills")


def test_what_is_refused(tmp_path):
    with pytest.raises(karst.DataError, match="none.karstdb"):
        karst.Saved(tmp_path / "none.karstdb")
    (tmp_path / "text.karstdb").write_text("text")
    with pytest.raises(karst.DataError):
        karst.Saved(tmp_path / "text.karstdb")
    saved = karst.Saved.create(tmp_path / "mine.karstdb", "hills")
    with pytest.raises(karst.UsageError):
        saved.append("sphere,0,0,0,-1")
    saved.close()
    with pytest.raises(ValueError, match="closed"):
        saved.commit()


def test_a_picture_of_a_saved_world(tmp_path, hills):
    edit = "sphere,40,290,80,20"
    with karst.Saved.create(tmp_path / "mine.karstdb", "hills", camera="0,330,0,30,-20") as saved:
        saved.append(edit)
        saved.commit()
        with karst.Engine(saved, **SMALL) as engine:
            colour = engine.render().colour
    with karst.Engine(hills, edits=edit, **SMALL) as engine:
        assert (engine.render("0,330,0,30,-20").colour == colour).all()
