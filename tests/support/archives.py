"""Archives and workbooks as small as they can be, and damage to the bytes of files."""

from __future__ import annotations

import io
import random
import zipfile
from collections.abc import Mapping

SHEET = '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>{}</sheetData></worksheet>'
OFFICE = "urn:oasis:names:tc:opendocument:xmlns:"
ODS = (f'<office:document-content xmlns:office="{OFFICE}office:1.0" xmlns:table="{OFFICE}table:1.0" '
       f'xmlns:text="{OFFICE}text:1.0"><office:body><office:spreadsheet><table:table table:name="one">{{}}'
       "</table:table></office:spreadsheet></office:body></office:document-content>")
ROWS = [(0.1 * i, (-1.0) ** i) for i in range(9)]
TABLE = "Time (s),Angle (rad)\n" + "".join(f"{t:.1f},{angle}\n" for t, angle in ROWS)


def archive(files: Mapping[str, str | bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return the bytes of a zip archive."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", compression) as file:
        for name, content in files.items():
            file.writestr(name, content)
    return made.getvalue()


def xlsx(cells: str = "") -> bytes:
    """Return a workbook of Excel with a short swing and further cells, in XML."""
    main, relations = "http://schemas.openxmlformats.org/", "http://schemas.openxmlformats.org/package/2006/relationships"
    kind = f"{main}officeDocument/2006/relationships"
    own = "".join(f'<row r="{i}"><c r="A{i}"><v>{t}</v></c><c r="B{i}"><v>{angle}</v></c></row>'
                  for i, (t, angle) in enumerate(ROWS, 1))
    return archive({
        "[Content_Types].xml": f'<Types xmlns="{main}package/2006/content-types"/>',
        "_rels/.rels": f'<Relationships xmlns="{relations}"><Relationship Id="r1" Type="{kind}/officeDocument" '
                       'Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}spreadsheetml/2006/main" xmlns:r="{kind}"><sheets>'
                           '<sheet name="one" sheetId="1" r:id="r1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{relations}"><Relationship Id="r1" '
                                      f'Type="{kind}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>',
        "xl/worksheets/sheet1.xml": SHEET.format(own + cells)})


def ods(rows: str = "") -> bytes:
    """Return a workbook of OpenDocument with a short swing and further rows, in XML."""
    cell = '<table:table-cell office:value-type="float" office:value="{}"/>'
    own = "".join(f"<table:table-row>{cell.format(t)}{cell.format(angle)}</table:table-row>" for t, angle in ROWS)
    return archive({"mimetype": "application/vnd.oasis.opendocument.spreadsheet", "content.xml": ODS.format(own + rows),
                    "META-INF/manifest.xml": "<manifest/>"})


def damaged(data: bytes, source: random.Random) -> bytes:
    """Return bytes with one kind of damage: flipped, cut off, left out, repeated, overwritten, or of another end."""
    found, kind = bytearray(data), source.randrange(6)
    place = source.randrange(max(len(found), 1))
    if kind == 0:
        for _ in range(source.choice((1, 1, 2, 8, 64))):
            found[source.randrange(len(found))] ^= 1 << source.randrange(8)
    elif kind == 1:
        del found[place:]
    elif kind == 2:
        del found[place : place + source.choice((1, 4, 64, 1024))]
    elif kind == 3:
        found[place:place] = found[place : place + source.choice((1, 16, 512))]
    elif kind == 4:
        found[place : place + 4] = source.choice((b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", b"9999"))
    else:
        found += found[:place]
    return bytes(found)
