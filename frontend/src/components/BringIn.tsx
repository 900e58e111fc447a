import { Button, FileButton } from "@mantine/core";
import { useBringIn } from "../api/files";
import { Trouble } from "./Trouble";

/** A campaign from another installation, as its bundle. */
export function BringIn() {
  const bringing = useBringIn();
  return (
    <div>
      <FileButton accept=".zip" onChange={(file) => file && bringing.mutate(file)}>
        {(props) => (
          <Button {...props} variant="default" loading={bringing.isPending}>
            Bring in a bundle
          </Button>
        )}
      </FileButton>
      <Trouble error={bringing.error} />
    </div>
  );
}
