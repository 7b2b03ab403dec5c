//! Writes built-in scenes as GLB files: `write_builtin FOLDER DETAIL NAME...`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(folder), Some(detail)) = (arguments.next(), arguments.next()) else {
        return Err("usage: write_builtin FOLDER DETAIL NAME...".into());
    };
    for name in arguments {
        let glb = dapple_scene::builtin::glb(&name, detail.parse()?)?;
        std::fs::write(std::path::Path::new(&folder).join(format!("{name}.glb")), glb)?;
    }
    Ok(())
}
