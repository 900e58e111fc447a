import { Button, FileButton } from "@mantine/core";
import { useImportBundle } from "../../api/files";
import { ErrorNotice } from "../../ui/ErrorNotice";

/** A campaign from another installation, as its bundle. */
export function ImportBundle() {
  const bringing = useImportBundle();
  return (
    <div>
      <FileButton accept=".zip" onChange={(file) => file && bringing.mutate(file)}>
        {(props) => (
          <Button {...props} variant="default" loading={bringing.isPending}>
            Bring in a bundle
          </Button>
        )}
      </FileButton>
      <ErrorNotice error={bringing.error} />
    </div>
  );
}
